// The map from above, north up: walls, trail, fixes, ellipse, vehicle, marks, grid, scale bar.

import { wrapped } from "./model.js";

const WITHIN = Math.sqrt(-2 * Math.log(0.05));  // deviations of an ellipse that holds 95 %
const MOST_TILES = 400;  // drawn tiles that are kept
const BARS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];

export class MapView {
  constructor(canvas, model, sonar) {
    Object.assign(this, { canvas, model, sonar, follow: true, overlay: true, time: null, scale: 12, centre: [0, 0] });
    this.context = canvas.getContext("2d");
    this.drawn = new Map();
    this.colors = {};
    this.touched = false;
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
    this.listen();
  }

  use(colors) {
    this.colors = colors;
    this.drawn.clear();
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

  listen() {
    const { canvas } = this, fingers = new Map();
    let moved = 0, apart = 0;
    const at = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, at(event));
      moved = fingers.size > 1 ? Infinity : 0;
      apart = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const now = at(event);
      fingers.set(event.pointerId, now);
      moved += Math.hypot(now[0] - before[0], now[1] - before[1]);
      const [one, other] = fingers.values();
      if (other) {
        const distance = Math.hypot(one[0] - other[0], one[1] - other[1]);
        if (apart) this.zoom(distance / apart, [(one[0] + other[0]) / 2, (one[1] + other[1]) / 2]);
        apart = distance;
      }
      if (moved > 5) this.pan((now[0] - before[0]) / fingers.size, (now[1] - before[1]) / fingers.size);
    });
    const lift = (event) => {
      if (fingers.delete(event.pointerId) && event.type === "pointerup" && moved <= 5 && this.onTouch) this.onTouch(this.toMap(at(event)));
      apart = 0;
    };
    canvas.addEventListener("pointerup", lift);
    canvas.addEventListener("pointercancel", lift);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), at(event));
    }, { passive: false });
  }

  draw() {
    const { context, model, colors } = this, place = this.shownPlace();
    if (this.follow && place) this.centre = [place[0], place[1]];
    if (!this.touched && model.tiles.size) this.fit();
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.fillStyle = colors.ground;
    context.fillRect(0, 0, this.width, this.height);
    this.drawGrid();
    if (this.overlay && this.time === null) this.sonar.drawOn(context, this.matrix());
    this.drawTiles();
    this.drawTrack();
    if (place) this.drawVehicle(place);
    this.drawMarks();
    this.drawScale();
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

  drawGrid() {
    const { context, colors } = this, step = BARS.find((bar) => bar * this.scale >= 60) || 5000;
    const corners = [[0, 0], [this.width, 0], [0, this.height], [this.width, this.height]].map((point) => this.toMap(point));
    context.lineWidth = 1;
    context.strokeStyle = colors.grid;
    context.beginPath();
    for (const axis of [0, 1]) {
      const own = corners.map((point) => point[axis]), other = corners.map((point) => point[1 - axis]);
      const ends = [Math.min(...other), Math.max(...other)];
      for (let value = Math.ceil(Math.min(...own) / step) * step; value <= Math.max(...own); value += step) {
        const line = ends.map((end) => this.toScreen(axis ? [end, value] : [value, end]));
        context.moveTo(...line[0]);
        context.lineTo(...line[1]);
      }
    }
    context.stroke();
  }

  drawTiles() {
    const { context, model } = this, { cell, side } = model.hello, range = model.levels();
    const pixels = 2 ** Math.min(Math.max(Math.ceil(Math.log2(cell * this.scale * this.ratio)), 0), 4);
    const born = this.time === null ? Infinity : Math.floor(this.time / model.hello.bornStep);
    const look = `${pixels} ${born} ${Math.round(range[0] / 3)} ${Math.round(range[1] / 3)}`;
    const width = cell * side, edge = cell;
    context.save();
    context.transform(...this.matrix());
    context.imageSmoothingEnabled = pixels < 16;
    for (const [key, tile] of model.tiles) {
      const middle = this.toScreen([(tile.x + 0.5) * width, (tile.y + 0.5) * width]), far = width * this.scale;
      if (middle[0] < -far || middle[1] < -far || middle[0] > this.width + far || middle[1] > this.height + far) continue;
      let known = this.drawn.get(key);
      if (!known || known.tile !== tile || known.look !== look) {
        known = { tile, look, picture: this.picture(tile, pixels, born, range) };
        this.drawn.delete(key);
        this.drawn.set(key, known);
      }
      context.drawImage(known.picture, tile.x * width - edge, tile.y * width - edge, width + 2 * edge, width + 2 * edge);
    }
    context.restore();
    while (this.drawn.size > MOST_TILES) this.drawn.delete(this.drawn.keys().next().value);
  }

  // A tile with one empty cell around it, in which blocks at its rim may end.
  picture(tile, pixels, born, [low, high]) {
    const { side } = this.model.hello, canvas = document.createElement("canvas"), ramp = this.colors.walls;
    canvas.width = canvas.height = (side + 2) * pixels;
    const context = canvas.getContext("2d");
    const order = Array.from(tile.index.keys()).filter((i) => tile.born[i] <= born).sort((i, j) => tile.level[i] - tile.level[j]);
    for (const i of order) {
      const share = Math.min(Math.max((tile.level[i] - low) / Math.max(high - low, 1), 0), 1);
      const size = Math.max(pixels * (0.5 + 0.75 * share), 1);
      const x = (1 + tile.index[i] % side + ((tile.within[i] >> 4) + 0.5) / 16) * pixels;
      const y = (1 + Math.floor(tile.index[i] / side) + ((tile.within[i] & 15) + 0.5) / 16) * pixels;
      context.fillStyle = ramp[Math.round(share * (ramp.length - 1))];
      context.fillRect(x - size / 2, y - size / 2, size, size);
    }
    return canvas;
  }

  drawTrack() {
    const { context, model, colors } = this, rows = model.upTo(model.track, this.time), place = this.shownPlace();
    const points = rows.map((row) => this.toScreen([row[1], row[2]]));
    if (place) points.push(this.toScreen(place));
    context.lineJoin = context.lineCap = "round";
    for (const [width, color] of [[5, colors.ground], [2.5, colors.trail]]) {
      context.lineWidth = width;
      context.strokeStyle = color;
      context.beginPath();
      points.forEach((point) => context.lineTo(...point));
      context.stroke();
    }
    context.fillStyle = colors.ground;
    context.strokeStyle = colors.trail;
    context.lineWidth = 1.5;
    for (const fix of model.upTo(model.fixes, this.time)) {
      const [x, y] = this.toScreen([fix[1], fix[2]]);
      context.beginPath();
      context.arc(x, y, 3, 0, 2 * Math.PI);
      context.fill();
      context.stroke();
    }
  }

  drawVehicle(place) {
    const { context, model, colors } = this, [x, y] = this.toScreen(place);
    const status = model.now && model.now.status, color = colors.states[status ? status.state : 3];
    const covariance = this.time === null && model.now && model.now.covariance;
    if (covariance && covariance.every((one) => one !== null)) this.drawEllipse([x, y], covariance, color);
    context.save();
    context.translate(x, y);
    context.rotate(Math.PI / 2 - wrapped(place[2] + this.turn));
    context.beginPath();
    [[0, -20], [10, 13], [0, 8], [-10, 13]].forEach((point) => context.lineTo(...point));
    context.closePath();
    context.lineJoin = "round";
    context.lineWidth = 5;
    context.strokeStyle = colors.halo;
    context.stroke();
    context.fillStyle = this.time === null ? colors.vehicle : colors.muted;
    context.fill();
    context.restore();
  }

  drawEllipse([x, y], [xx, xy, yy], color) {
    const { context } = this, mean = (xx + yy) / 2, apart = Math.hypot((xx - yy) / 2, xy);
    const [long, short] = [mean + apart, Math.max(mean - apart, 0)].map((value) => WITHIN * Math.sqrt(value) * this.scale);
    const direction = Math.atan2(2 * xy, xx - yy) / 2 + this.turn;
    context.beginPath();
    context.ellipse(x, y, Math.max(long, 1), Math.max(short, 1), -direction, 0, 2 * Math.PI);
    context.globalAlpha = 0.18;
    context.fillStyle = color;
    context.fill();
    context.globalAlpha = 1;
    context.lineWidth = 2.5;
    context.strokeStyle = color;
    context.stroke();
  }

  drawMarks() {
    const { context, colors } = this;
    context.font = "600 14px system-ui, sans-serif";
    context.textBaseline = "middle";
    for (const [name, mx, my] of this.model.marks) {
      const [x, y] = this.toScreen([mx, my]);
      context.fillStyle = colors.mark;
      context.strokeStyle = colors.halo;
      context.lineWidth = 3;
      context.beginPath();
      [[0, 0], [-7, -15], [0, -22], [7, -15]].forEach(([dx, dy]) => context.lineTo(x + dx, y + dy));
      context.closePath();
      context.stroke();
      context.fill();
      context.lineWidth = 4;
      context.strokeText(name, x + 12, y - 13);
      context.fillStyle = colors.ink;
      context.fillText(name, x + 12, y - 13);
    }
  }

  drawScale() {
    const { context, colors } = this, length = BARS.filter((bar) => bar * this.scale <= Math.min(140, this.width / 3)).pop() || BARS[0];
    const x = 18, y = this.height - 20, end = x + length * this.scale;
    context.lineCap = "butt";
    for (const [width, color] of [[6, colors.ground], [2.5, colors.ink]]) {
      context.lineWidth = width;
      context.strokeStyle = color;
      context.beginPath();
      [[x, y - 7], [x, y], [end, y], [end, y - 7]].forEach((point) => context.lineTo(...point));
      context.stroke();
    }
    context.font = "600 14px system-ui, sans-serif";
    context.textBaseline = "bottom";
    context.lineWidth = 4;
    context.strokeStyle = colors.ground;
    context.fillStyle = colors.ink;
    context.strokeText(`${length} m`, x + 6, y - 4);
    context.fillText(`${length} m`, x + 6, y - 4);
    this.drawNorth(34, 44);
  }

  drawNorth(x, y) {
    const { context, colors } = this;
    context.beginPath();
    context.arc(x, y, 20, 0, 2 * Math.PI);
    context.fillStyle = colors.card;
    context.fill();
    context.beginPath();
    [[0, -16], [6, 2], [0, -2], [-6, 2]].forEach(([dx, dy]) => context.lineTo(x + dx, y + dy));
    context.closePath();
    context.fillStyle = colors.states[3];
    context.fill();
    context.fillStyle = colors.ink;
    context.textAlign = "center";
    context.textBaseline = "alphabetic";
    context.font = "700 13px system-ui, sans-serif";
    context.fillText("N", x, y + 14);
    context.textAlign = "left";
  }
}
