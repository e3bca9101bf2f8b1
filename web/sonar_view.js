// The newest revolution of the sonar as operators know it: bow up or north up, range rings, the sweep.

import { line, outlined } from "./pen.js";

const SLOTS = 1024, BINS = 200, RADIUS = 200;

export class SonarView {
  constructor(canvas, model) {
    Object.assign(this, { canvas, model, reach: 0, bowUp: true, ramp: null, sweep: null });
    this.context = canvas.getContext("2d");
    this.beams = new Map();  // by their direction from the bow
    this.tables = { fromBow: new Uint8Array(SLOTS * BINS), inMap: new Uint8Array(SLOTS * BINS) };
    this.lookup = pixels();
    this.picture = blank();
    new ResizeObserver(() => { this.isDirty = true; }).observe(canvas);
  }

  use(colors) {
    this.colors = colors;
    this.repaint();
  }

  clear() {
    for (const table of Object.values(this.tables)) table.fill(0);
    this.beams.clear();
    this.sweep = null;
    this.repaint();
  }

  repaint() { this.isDirty = this.stale = true; }

  take(beam) {
    if (Math.abs(beam.reach - this.reach) > 0.01 * beam.reach) {
      this.clear();
      this.reach = beam.reach;
    }
    for (const [name, table] of Object.entries(this.tables)) {
      const half = Math.ceil(beam.width / 2 / (2 * Math.PI) * SLOTS), middle = Math.round(beam[name] / (2 * Math.PI) * SLOTS);
      for (let slot = middle - half; slot <= middle + half; slot += 1) {
        const start = ((slot % SLOTS) + SLOTS) % SLOTS * BINS;
        for (let bin = 0; bin < BINS; bin += 1) table[start + bin] = beam.strengths[Math.floor(bin * beam.strengths.length / BINS)];
      }
    }
    const slot = Math.round(beam.fromBow / (2 * Math.PI) * 400);
    this.beams.delete(slot);
    this.beams.set(slot, { ...beam, ...peaks(beam.strengths) });
    this.sweep = beam;
    this.repaint();
  }

  get north() { return this.model.hello.azimuth * Math.PI / 180; }  // in the map, counter-clockwise from x

  // Paint the table that is shown: up is the bow, or north.
  paint(name) {
    const { context, image } = this.picture, words = new Uint32Array(image.data.buffer), { slot, bin } = this.lookup;
    const offset = name === "inMap" ? Math.round(this.north / (2 * Math.PI) * SLOTS) : 0, table = this.tables[name];
    for (let i = 0; i < words.length; i += 1) {
      words[i] = bin[i] < BINS ? this.colors.sonar[table[((slot[i] + offset) & (SLOTS - 1)) * BINS + bin[i]]] : 0;
    }
    context.putImageData(image, 0, 0);
    this.stale = false;
  }

  // The strong echoes of the newest revolution, each where it was heard from.
  drawOn(context, matrix) {
    context.save();
    context.transform(...matrix);
    context.strokeStyle = this.colors.echo;
    const beams = [...this.beams.values()], least = Math.max(60, 0.6 * Math.max(...beams.map((beam) => beam.strongest)));
    let share = 0;
    for (const { x, y, inMap, width, reach, strengths, peaks } of beams) {
      share += 1 / beams.length;
      context.globalAlpha = 0.25 + 0.6 * share;
      context.lineWidth = 1.5 * reach / strengths.length;
      for (const bin of peaks) {
        if (strengths[bin] < least) continue;
        context.beginPath();
        context.arc(x, y, (bin + 0.5) / strengths.length * reach, inMap - width / 2, inMap + width / 2);
        context.stroke();
      }
    }
    context.restore();
  }

  draw() {
    const { canvas, context, colors } = this, ratio = window.devicePixelRatio || 1, side = canvas.clientWidth;
    if (!side) return;
    if (canvas.width !== Math.round(side * ratio)) canvas.width = canvas.height = Math.round(side * ratio);
    const name = this.bowUp ? "fromBow" : "inMap", radius = side / 2 - 16, middle = side / 2;
    if (this.stale) this.paint(name);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, side, side);
    context.fillStyle = colors.water;
    context.beginPath();
    context.arc(middle, middle, radius, 0, 2 * Math.PI);
    context.fill();
    context.imageSmoothingQuality = "high";
    context.drawImage(this.picture.canvas, middle - radius, middle - radius, 2 * radius, 2 * radius);
    this.drawRings(middle, radius);
    if (this.sweep) {
      const angle = this.sweep[name] - (this.bowUp ? 0 : this.north);
      line(context, [[middle, middle], [middle - radius * Math.sin(angle), middle - radius * Math.cos(angle)]], colors.sweep, 2);
    }
    this.drawBow(middle);
    this.isDirty = false;
  }

  drawRings(middle, radius) {
    const { context, colors } = this, step = [0.5, 1, 2, 5, 10, 20, 50].find((one) => this.reach / one <= 5) || 100;
    context.strokeStyle = colors.ring;
    context.lineWidth = 1;
    context.font = "600 11px system-ui, sans-serif";
    context.textAlign = "center";
    context.textBaseline = "middle";
    for (let range = step; this.reach && range < this.reach * 0.999; range += step) {
      const size = range / this.reach * radius;
      context.beginPath();
      context.arc(middle, middle, size, 0, 2 * Math.PI);
      context.stroke();
      context.fillStyle = colors.ringInk;
      context.fillText(`${range}`, middle + size * Math.SQRT1_2, middle + size * Math.SQRT1_2);
    }
    context.beginPath();
    context.arc(middle, middle, radius, 0, 2 * Math.PI);
    context.stroke();
    context.fillStyle = colors.ink;
    const words = this.bowUp ? ["bow", "90°", "180°", "270°"] : ["N", "E", "S", "W"];
    words.forEach((word, i) => {
      const x = middle + (radius + 8) * Math.sin(i * Math.PI / 2), y = middle - (radius + 8) * Math.cos(i * Math.PI / 2);
      context.save();
      context.translate(x, y);
      context.rotate(i === 1 ? Math.PI / 2 : i === 3 ? -Math.PI / 2 : 0);
      context.fillText(word, 0, 0);
      context.restore();
    });
  }

  drawBow(middle) {
    const { context, colors } = this, place = this.model.place;
    context.save();
    context.translate(middle, middle);
    if (!this.bowUp && place) context.rotate(place[4] * Math.PI / 180);
    outlined(context, [[0, -9], [6, 7], [0, 4], [-6, 7]], colors.vehicle, colors.halo, 2);
    context.restore();
  }
}

// The bins of a beam that stand out in it.
function peaks(strengths) {
  const strongest = strengths.reduce((most, one) => Math.max(most, one), 0);
  return { strongest, peaks: Array.from(strengths.keys()).filter((bin) => strengths[bin] >= 0.6 * strongest) };
}

function blank() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 2 * RADIUS;
  const context = canvas.getContext("2d");
  return { canvas, context, image: context.createImageData(2 * RADIUS, 2 * RADIUS) };
}

// Which direction and which bin every pixel shows.
function pixels() {
  const side = 2 * RADIUS, slot = new Uint16Array(side * side), bin = new Uint16Array(side * side);
  for (let i = 0; i < side * side; i += 1) {
    const left = RADIUS - 0.5 - i % side, up = RADIUS - 0.5 - Math.floor(i / side);
    slot[i] = (Math.round(Math.atan2(left, up) / (2 * Math.PI) * SLOTS) + SLOTS) % SLOTS;
    bin[i] = Math.floor(Math.hypot(left, up) / RADIUS * BINS);
  }
  return { slot, bin };
}
