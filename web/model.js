// All that the page knows of one run: the newest of each thing, and how it was at earlier times.

const LEAST_SPAN = 24;  // levels, three doublings: where all cells are alike, all are strong

export class Model {
  constructor() {
    this.run = "";
    this.revision = 0;
    this.hello = { cell: 0.5, side: 32, bornStep: 2, azimuth: 90 };
    this.now = null;
    this.version = 0;  // grows with each change that the map shows
    this.clear();
  }

  clear() {
    Object.assign(this, {
      tiles: new Map(), tracks: [], fixChunks: [], stages: new Map(), marks: [], range: [0, 1], rangeOf: -1,
    });
    this.track = this.fixes = [];
  }

  take(kind, content) {
    const taker = this[`take_${kind}`];
    if (taker) taker.call(this, content);
    this.version += 1;
  }

  take_hello(hello) {
    if (hello.run !== this.run) {
      this.clear();
      this.now = null;
    }
    this.run = hello.run;
    this.hello = hello;
  }

  take_revision(revision) { this.revision = revision; }

  take_now(now) {
    this.now = now;
    this.before = this.place || now.pose;
    this.since = performance.now();
  }

  take_tile(tile) {
    const key = `${tile.x},${tile.y}`;
    if (tile.index.length) this.tiles.set(key, tile);
    else this.tiles.delete(key);
    this.tilesVersion = (this.tilesVersion || 0) + 1;
  }

  take_track({ chunk, rows }) { this.track = replaced(this.tracks, chunk, rows); }
  take_fixes({ chunk, rows }) { this.fixes = replaced(this.fixChunks, chunk, rows); }
  take_stage(stage) { this.stages.set(stage.name, { ...stage, heard: performance.now() }); }
  take_marks(marks) { this.marks = marks; }

  // Where the vehicle is drawn: it glides from one report to the next. [x, y, yaw, depth, heading]
  get place() {
    const to = this.now && this.now.pose, from = this.before;
    if (!to || !from) return to;
    const share = Math.min((performance.now() - this.since) / 260, 1);
    const turn = wrapped(to[2] - from[2]);
    return [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1]), from[2] + share * turn, to[3], to[4]];
  }

  get isGliding() { return this.now && performance.now() - this.since < 300; }

  // Rows of the track or of the fixes up to a time; all of them where it is null.
  upTo(rows, time) {
    return time === null ? rows : rows.slice(0, rows.findIndex((row) => row[0] > time) >>> 0);
  }

  // The levels that the faintest and the strongest colour stand for.
  levels() {
    if (this.rangeOf !== this.tilesVersion) {
      const counts = new Uint32Array(256);
      let total = 0;
      for (const { level } of this.tiles.values()) for (const one of level) { counts[one] += 1; total += 1; }
      const high = quantile(counts, 0.9 * total);
      this.range = [Math.min(quantile(counts, 0.05 * total), high - LEAST_SPAN), high];
      this.rangeOf = this.tilesVersion;
    }
    return this.range;
  }
}

export function wrapped(angle) {
  return angle - 2 * Math.PI * Math.round(angle / (2 * Math.PI));
}

function replaced(chunks, chunk, rows) {
  chunks[chunk] = rows;
  return Array.from(chunks, (one) => one || []).flat();
}

function quantile(counts, wanted) {
  let sum = 0;
  return Math.max(counts.findIndex((count) => (sum += count) > wanted), 0);
}
