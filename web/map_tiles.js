// The walls: every tile of the map as a picture, drawn anew only where it or its colours changed.

const MOST_TILES = 400;  // pictures that are kept

export class MapTiles {
  constructor(view) {
    this.view = view;
    this.drawn = new Map();
  }

  clear() { this.drawn.clear(); }

  draw() {
    const { view } = this, { context, model, time, scale, ratio } = view, { cell, side } = model.hello, range = model.levels();
    const pixels = 2 ** Math.min(Math.max(Math.ceil(Math.log2(cell * scale * ratio)), 0), 4);
    const born = time === null ? Infinity : Math.floor(time / model.hello.bornStep);
    const look = `${pixels} ${born} ${Math.round(range[0] / 3)} ${Math.round(range[1] / 3)}`;
    const width = cell * side, edge = cell;
    context.save();
    context.transform(...view.matrix());
    context.imageSmoothingEnabled = pixels < 16;
    for (const [key, tile] of model.tiles) {
      const middle = view.toScreen([(tile.x + 0.5) * width, (tile.y + 0.5) * width]), far = width * scale;
      if (middle[0] < -far || middle[1] < -far || middle[0] > view.width + far || middle[1] > view.height + far) continue;
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
    const { side } = this.view.model.hello, canvas = document.createElement("canvas"), ramp = this.view.colors.walls;
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
}
