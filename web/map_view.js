// The map from above, north up: which part of it is seen, and at which time.

import { listen } from "./gestures.js";
import { drawGrid, drawMarks, drawNorth, drawScale, drawTrack, drawVehicle } from "./map_symbols.js";
import { MapTiles } from "./map_tiles.js";

export class MapView {
  constructor(canvas, model, sonar) {
    Object.assign(this, { canvas, model, sonar, follow: true, overlay: true, time: null, scale: 12, centre: [0, 0] });
    this.context = canvas.getContext("2d");
    this.tiles = new MapTiles(this);
    this.colors = {};
    this.touched = false;
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    listen(canvas, this);
  }

  use(colors) {
    this.colors = colors;
    this.tiles.clear();
    this.isDirty = true;
  }

  resize() {
    this.ratio = window.devicePixelRatio || 1;
    const { clientWidth, clientHeight } = this.canvas;
    Object.assign(this, { width: clientWidth, height: clientHeight });
    this.canvas.width = Math.round(clientWidth * this.ratio);
    this.canvas.height = Math.round(clientHeight * this.ratio);
    this.isDirty = true;
  }

  get turn() { return (90 - this.model.hello.azimuth) * Math.PI / 180; }  // of the map, so that north is up

  // From the map to the screen: a, b, c, d, e, f of a canvas.
  matrix() {
    const s = this.scale, cos = s * Math.cos(this.turn), sin = s * Math.sin(this.turn), [x, y] = this.centre;
    return [cos, -sin, -sin, -cos, this.width / 2 - cos * x + sin * y, this.height / 2 + sin * x + cos * y];
  }

  toScreen([x, y]) {
    const [a, b, c, d, e, f] = this.matrix();
    return [a * x + c * y + e, b * x + d * y + f];
  }

  toMap([x, y]) {
    const [a, b, c, d, e, f] = this.matrix(), size = a * d - b * c;
    return [(d * (x - e) - c * (y - f)) / size, (a * (y - f) - b * (x - e)) / size];
  }

  zoom(factor, at = [this.width / 2, this.height / 2]) {
    const fixed = this.toMap(at);
    this.scale = Math.min(Math.max(this.scale * factor, 0.2), 400);
    const moved = this.toMap(at);
    if (!this.follow) this.centre = this.centre.map((value, i) => value + fixed[i] - moved[i]);
    this.touched = this.isDirty = true;
  }

  pan(dx, dy) {
    const from = this.toMap([0, 0]), to = this.toMap([dx, dy]);
    this.centre = this.centre.map((value, i) => value + from[i] - to[i]);
    this.setFollow(false);
    this.touched = true;
  }

  setFollow(follow) {
    this.follow = follow;
    this.isDirty = true;
    if (this.onFollow) this.onFollow(follow);
  }

  // Show all that is known.
  whole() {
    const { cell, side } = this.model.hello, corners = [];
    for (const { x, y } of this.model.tiles.values()) {
      for (const [i, j] of [[0, 0], [0, 1], [1, 0], [1, 1]]) corners.push([(x + i) * side * cell, (y + j) * side * cell]);
    }
    corners.push(...this.model.track.map((row) => [row[1], row[2]]));
    if (!corners.length) return;
    const turned = corners.map((point) => this.toScreen(point));
    const low = [0, 1].map((i) => turned.reduce((least, one) => Math.min(least, one[i]), Infinity));
    const high = [0, 1].map((i) => turned.reduce((most, one) => Math.max(most, one[i]), -Infinity));
    this.centre = this.toMap(low.map((value, i) => (value + high[i]) / 2));
    this.scale *= Math.min(this.width / (high[0] - low[0] + 40), this.height / (high[1] - low[1] + 40), 1e3);
    this.setFollow(false);
  }

  draw() {
    const { context, model, colors } = this, place = this.shownPlace();
    if (this.follow && place) this.centre = [place[0], place[1]];
    if (!this.touched && model.tiles.size) this.fit();
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.fillStyle = colors.ground;
    context.fillRect(0, 0, this.width, this.height);
    drawGrid(this);
    if (this.overlay && this.time === null) this.sonar.drawOn(context, this.matrix());
    this.tiles.draw();
    drawTrack(this, place);
    if (place) drawVehicle(this, place);
    drawMarks(this);
    drawScale(this);
    drawNorth(this);
    this.isDirty = false;
  }

  // At first, as near as the sonar hears.
  fit() {
    const reach = this.sonar.reach || 20;
    this.scale = Math.min(Math.max(Math.min(this.width, this.height) / (2.2 * Math.min(reach, 40)), 3), 80);
  }

  shownPlace() {
    if (this.time === null) return this.model.place;
    const rows = this.model.upTo(this.model.track, this.time), row = rows[rows.length - 1];
    return row && [row[1], row[2], row[3]];
  }
}
