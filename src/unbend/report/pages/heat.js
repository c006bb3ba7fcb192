// A heat map with its dendrogram: a cell for each two shapes, pointed at, clicked, or gone to by keys.

const LARGEST_CELL = 84, READABLE = 34, NAMED = 13, PICTURED = 30; // sides of a cell in pixels
const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, sans-serif";

// `pointed(i, j, clicked)` is called with two shapes, or -1 twice. `pictures` are canvases by shape.
class HeatMap {
  constructor(canvas, { shapes, table, cells, digits, order, tree }, pictures, pointed) {
    const n = order.length, pixels = Object.assign(document.createElement("canvas"), { width: n, height: n });
    pixels.getContext("2d").putImageData(new ImageData(Uint8ClampedArray.from(cells), n, n), 0, 0);
    Object.assign(this, { canvas, shapes, table, cells, pixels, digits, order, tree, pictures, pointed, n });
    canvas.shown = this; // for whoever asks where cells are
    this.at = this.kept = null; // row and column of the cell that is told, and of the one kept
    new ResizeObserver(() => this.draw()).observe(canvas.parentElement);
    this.listen();
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
  }

  draw() {
    const { canvas, n, order } = this, ratio = window.devicePixelRatio || 1;
    const context = canvas.getContext("2d");
    this.measureOut(context);
    const height = this.top + this.side + 1;
    canvas.style.height = `${height}px`;
    canvas.width = Math.round(this.width * ratio);
    canvas.height = Math.round(height * ratio);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const style = getComputedStyle(document.documentElement);
    const [ink, soft, accent] = ["--ink", "--soft", "--target"].map((name) => style.getPropertyValue(name));
    const { tall, top, cell, side } = this;
    context.imageSmoothingEnabled = false;
    context.drawImage(this.pixels, tall, top, side, side);
    context.font = FONT;
    context.textBaseline = "middle";
    if (cell >= READABLE) {
      const digits = Math.max(2, Math.min(this.digits, Math.floor(cell / 8) - 2));
      context.textAlign = "center";
      for (let row = 0; row < n; row++) {
        for (let column = 0; column < n; column++) {
          const value = this.table[order[row] * n + order[column]], at = 4 * (row * n + column);
          const [r, g, b] = this.cells.subarray(at, at + 3);
          context.fillStyle = 0.3 * r + 0.59 * g + 0.11 * b > 125 ? "#000" : "#fff";
          const told = value < 0 ? "?" : value.toFixed(digits);
          context.fillText(told, tall + (column + 0.5) * cell, top + (row + 0.5) * cell);
        }
      }
    }
    context.textAlign = "left";
    context.fillStyle = ink;
    order.forEach((i, row) => {
      if (top) this.drawPicture(context, i, tall + row * cell, 0);
      if (!this.names) return;
      let x = tall + side + 6;
      if (top) {
        this.drawPicture(context, i, x - 4, top + row * cell);
        x += cell;
      }
      context.fillText(shortened(context, this.shapes[i].name, this.width - x), x, top + (row + 0.5) * cell);
    });
    context.strokeStyle = soft;
    context.beginPath();
    const across = (share) => (tall - 4) * (1 - share) + 1, down = (place) => top + (place + 0.5) * cell;
    for (const bracket of this.tree) {
      bracket.forEach(([share, place], i) => context[i ? "lineTo" : "moveTo"](across(share), down(place)));
    }
    context.stroke();
    if (!this.at) return;
    const [row, column] = this.at;
    context.strokeStyle = accent;
    context.lineWidth = 1;
    context.strokeRect(tall, top + row * cell, side, cell);
    context.strokeRect(tall + column * cell, top, cell, side);
    context.lineWidth = 3;
    context.strokeRect(tall + column * cell, top + row * cell, cell, cell);
  }

  drawPicture(context, i, x, y) {
    const picture = this.pictures[i], { cell } = this;
    if (!picture?.width) return;
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

function shortened(context, text, width) {
  if (context.measureText(text).width <= width) return text;
  let kept = text.length;
  while (kept > 1 && context.measureText(`${text.slice(0, kept)}\u2026`).width > width) kept--;
  return `${text.slice(0, kept)}\u2026`;
}
