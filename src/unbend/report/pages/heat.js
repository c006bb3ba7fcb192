// A heat map with its dendrogram: a cell for each two shapes, pointed at, clicked, or gone to by keys.
"use strict";

// Viridis of matplotlib, at every tenth.
const VIRIDIS = [
  [68, 1, 84], [72, 40, 120], [62, 73, 137], [49, 104, 142], [38, 130, 142], [31, 158, 137],
  [53, 183, 121], [110, 206, 88], [181, 222, 43], [253, 231, 37],
];
function viridis(share) {
  const at = Math.max(0, Math.min(1, share)) * (VIRIDIS.length - 1);
  const i = Math.min(Math.floor(at), VIRIDIS.length - 2);
  return VIRIDIS[i].map((value, k) => value + (at - i) * (VIRIDIS[i + 1][k] - value));
}

const LARGEST_CELL = 84, READABLE = 34, NAMED = 13, PICTURED = 30; // sides of a cell in pixels

// `pointed(i, j, clicked)` is called with two shapes, or -1 twice. `pictures` are canvases by shape.
class HeatMap {
  constructor(canvas, { shapes, table, order, tree, measure }, pictures, pointed) {
    Object.assign(this, { canvas, shapes, table, order, tree, measure, pictures, pointed });
    this.n = order.length;
    canvas.shown = this; // for whoever asks where cells are
    this.at = this.kept = null; // row and column of the cell that is told, and of the one kept
    const others = table.filter((value, k) => value >= 0 && k % (this.n + 1));
    this.low = measure === "similarity" ? others.reduce((a, b) => Math.min(a, b), 1) : 0;
    this.high = measure === "similarity" ? 1 : others.reduce((a, b) => Math.max(a, b), 0);
    if (this.high - this.low < 1e-9) this.low = this.high - 1;
    const ends = [this.low, this.high].map((value) => value.toFixed(3));
    if (measure === "distance") ends.reverse();
    [part("least").textContent, part("most").textContent] = [`${measure} ${ends[0]}`, ends[1]];
    new ResizeObserver(() => this.draw()).observe(canvas.parentElement);
    this.listen();
  }

  value(row, column) {
    return this.table[this.order[row] * this.n + this.order[column]];
  }

  color(value) {
    if (value < 0) return [160, 160, 160]; // unknown
    const share = (value - this.low) / (this.high - this.low);
    return viridis(this.measure === "similarity" ? share : 1 - share);
  }

  measureOut(context) {
    const { n, canvas } = this, width = canvas.parentElement.clientWidth;
    context.font = FONT;
    const names = this.order.map((i) => context.measureText(this.shapes[i].name).width);
    this.tall = Math.min(110, width * 0.15); // of the dendrogram
    const room = Math.min(Math.max(...names) + 12, 150, width * 0.25);
    this.cell = Math.min(LARGEST_CELL, (width - this.tall - room) / n);
    if (this.cell >= PICTURED) this.cell = Math.min(LARGEST_CELL, (width - this.tall - room) / (n + 1));
    this.top = this.cell >= PICTURED ? this.cell : 0;
    this.names = this.cell >= NAMED ? room : 0;
    if (!this.names) this.cell = (width - this.tall) / n;
    this.side = this.cell * n;
    this.width = width;
    this.height = this.top + this.side + 1;
  }

  draw() {
    const { canvas, n, order } = this, ratio = window.devicePixelRatio || 1;
    const context = canvas.getContext("2d");
    this.measureOut(context);
    canvas.style.height = `${this.height}px`;
    canvas.width = Math.round(this.width * ratio);
    canvas.height = Math.round(this.height * ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const style = getComputedStyle(document.documentElement);
    const [ink, soft, accent] = ["--ink", "--soft", "--target"].map((name) => style.getPropertyValue(name));
    const { tall, top, cell } = this;
    context.drawImage(this.colors(), tall, top, this.side, this.side);
    context.font = FONT;
    context.textBaseline = "middle";
    if (cell >= READABLE) {
      // As many digits as tell values apart, if there is room for them.
      const apart = Math.ceil(-Math.log10((this.high - this.low) / 50));
      const digits = Math.max(2, Math.min(apart, 4, Math.floor(cell / 8) - 2));
      context.textAlign = "center";
      for (let row = 0; row < n; row++) {
        for (let column = 0; column < n; column++) {
          const value = this.value(row, column);
          const [r, g, b] = this.color(value);
          context.fillStyle = 0.3 * r + 0.59 * g + 0.11 * b > 125 ? "#000" : "#fff";
          const told = value < 0 ? "?" : value.toFixed(digits);
          context.fillText(told, tall + (column + 0.5) * cell, top + (row + 0.5) * cell);
        }
      }
    }
    context.textAlign = "left";
    context.fillStyle = ink;
    order.forEach((i, row) => {
      if (this.top) this.drawPicture(context, i, tall + row * cell, 0);
      if (!this.names) return;
      let x = tall + this.side + 6;
      if (this.top) {
        this.drawPicture(context, i, x - 4, top + row * cell);
        x += cell;
      }
      context.fillText(shortened(context, this.shapes[i].name, this.width - x), x, top + (row + 0.5) * cell);
    });
    context.strokeStyle = soft;
    context.beginPath();
    const across = (share) => (tall - 4) * (1 - share) + 1, down = (place) => top + (place + 0.5) * cell;
    for (const [first, second, join, from, to] of this.tree) {
      context.moveTo(across(first), down(from));
      context.lineTo(across(join), down(from));
      context.lineTo(across(join), down(to));
      context.lineTo(across(second), down(to));
    }
    context.stroke();
    if (!this.at) return;
    const [row, column] = this.at;
    context.strokeStyle = accent;
    context.lineWidth = 1;
    context.strokeRect(tall, top + row * cell, this.side, cell);
    context.strokeRect(tall + column * cell, top, cell, this.side);
    context.lineWidth = 3;
    context.strokeRect(tall + column * cell, top + row * cell, cell, cell);
  }

  // The cells as a picture of a pixel each, made larger without blur.
  colors() {
    if (!this.pixels) {
      const { n } = this, small = Object.assign(document.createElement("canvas"), { width: n, height: n });
      const image = new ImageData(n, n);
      for (let row = 0; row < n; row++) {
        for (let column = 0; column < n; column++) {
          image.data.set([...this.color(this.value(row, column)), 255], 4 * (row * n + column));
        }
      }
      small.getContext("2d").putImageData(image, 0, 0);
      this.pixels = small;
    }
    this.canvas.getContext("2d").imageSmoothingEnabled = false;
    return this.pixels;
  }

  drawPicture(context, i, x, y) {
    const picture = this.pictures[i], { cell } = this;
    if (!picture || !picture.width) return;
    const scale = cell / Math.max(picture.width, picture.height);
    const width = picture.width * scale, height = picture.height * scale;
    context.imageSmoothingEnabled = true;
    context.imageSmoothingQuality = "high";
    context.drawImage(picture, x + (cell - width) / 2, y + (cell - height) / 2, width, height);
  }

  cellAt(event) {
    const box = this.canvas.getBoundingClientRect();
    const row = Math.floor((event.clientY - box.top - this.top) / this.cell);
    const column = Math.floor((event.clientX - box.left - this.tall) / this.cell);
    return [row, column].every((k) => k >= 0 && k < this.n) ? [row, column] : null;
  }

  choose(at, clicked) {
    this.at = at;
    this.draw();
    this.pointed(...(at ? at.map((k) => this.order[k]) : [-1, -1]), clicked);
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("pointermove", (event) => {
      const at = this.cellAt(event);
      if (String(at) !== String(this.at)) this.choose(at || this.kept, false);
    });
    canvas.addEventListener("pointerleave", () => this.choose(this.kept, false));
    canvas.addEventListener("click", (event) => {
      const at = this.cellAt(event);
      if (at) this.choose(this.kept = at, true);
    });
    canvas.addEventListener("keydown", (event) => {
      const moves = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };
      if (event.key in moves) {
        const from = this.kept || [0, 0], by = this.kept ? moves[event.key] : [0, 0];
        this.kept = from.map((k, i) => Math.max(0, Math.min(this.n - 1, k + by[i])));
        this.choose(this.kept, false);
      } else if (event.key === "Enter" && this.kept) this.choose(this.kept, true);
      else return;
      event.preventDefault();
    });
  }
}

const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";

function shortened(context, text, width) {
  if (context.measureText(text).width <= width) return text;
  let kept = text.length;
  while (kept > 1 && context.measureText(`${text.slice(0, kept)}\u2026`).width > width) kept--;
  return `${text.slice(0, kept)}\u2026`;
}
