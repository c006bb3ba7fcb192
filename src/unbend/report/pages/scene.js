// Views of lit meshes with marks on their vertices, and the vertex under the pointer.

const HIDDEN = -0.3; // how little a vertex may face the viewer while its mark is still seen
const NEAREST = 9; // pixels from the pointer within which a vertex off the surface still counts
// Without a graphics processor, larger meshes have fewer faces until nothing moved for so many
// milliseconds.
const MANY_FACES = 20000, STILL = 300;

// Azimuth (how far the viewer walks to the shape's left), elevation, zoom and shift. Views that
// share one turn together. The axis that points upward is what is chosen on the page, or `fixed`.
class Camera {
  constructor(azimuth = 50, elevation = 15, fixed) {
    this.home = { azimuth, elevation, zoom: 1, x: 0, y: 0 };
    this.fixed = fixed;
    this.reset();
  }
  get up() {
    return this.fixed || part("up").value;
  }
  change(what) {
    Object.assign(this, what);
    for (const view of View.all) if (view.camera === this) view.draw();
  }
  reset() {
    this.change(this.home);
  }
  turn(azimuth, elevation) {
    const tilted = Math.max(-90, Math.min(90, this.elevation + elevation));
    this.change({ azimuth: this.azimuth + azimuth, elevation: tilted });
  }
  zoomBy(factor) {
    this.change({ zoom: Math.max(0.3, Math.min(40, this.zoom * factor)) });
  }
  shift(x, y) {
    this.change({ x: this.x + x, y: this.y + y });
  }
  matrix() { // by rows: right, up, towards the viewer
    const a = this.azimuth * Math.PI / 180, e = this.elevation * Math.PI / 180;
    const ca = Math.cos(a), sa = Math.sin(a), ce = Math.cos(e), se = Math.sin(e);
    const turn = [ca, 0, -sa, -se * sa, ce, -se * ca, ce * sa, se, ce * ca];
    // Each column, an axis of the shape, is one of the turn's or its opposite.
    const columns = { x: [1, 0, 2], y: [0, 1, 2], z: [0, 2, 1] }[this.up];
    const opposite = { x: 1, z: 1 }[this.up];
    return turn.map((_, i) => (i % 3 === opposite ? -1 : 1) * turn[i - i % 3 + columns[i % 3]]);
  }
}

// One canvas. `meshes` are drawn, and on them marks: {mesh, vertex, tint, label}. `pointed(vertex,
// clicked)` is called with the vertex of the first mesh under the pointer, or -1.
class View {
  static all = [];

  // `room` is what roomFor says of everything that will be drawn.
  constructor(canvas, camera, room) {
    Object.assign(this, room, {
      canvas, camera, meshes: [], landmarks: [], marks: [], // of what is pointed at
      fat: 0, paint: 0, wire: false, grid: true, cells: [0, 0], // grid lines as of boxAround
      pointed: () => {},
    });
    openStage();
    View.all.push(this);
    canvas.view = this; // for tests
    canvas.addEventListener("contextrestored", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(canvas);
    this.listen();
  }

  // positions, faces, and per vertex perhaps place (3), value and known; tint where paint is 2.
  add(columns) {
    this.meshes.push(new Surface(columns));
    this.draw();
  }

  // Take all meshes away.
  clear() {
    for (const mesh of this.meshes) mesh.close();
    this.meshes = [];
  }

  // Change a column of the first mesh.
  set(column, values) {
    this.meshes[0].set(column, values);
    this.draw();
  }

  // Change how the meshes are drawn, or the marks on them.
  change(what) {
    Object.assign(this, what);
    this.draw();
  }

  draw() {
    this.resting = 0;
    this.waiting ||= requestAnimationFrame(() => {
      this.waiting = 0;
      const many = stage.slow && this.painted && this.meshes.some(({ faces }) => faces.length > 3 * MANY_FACES);
      this.paintNow(many);
      this.painted = true;
      if (many) this.rest();
    });
  }

  // Draw all faces once nothing has moved, counted from when this frame is through.
  rest() {
    const mine = this.resting = performance.now();
    requestAnimationFrame(() => setTimeout(() => {
      if (this.resting === mine) this.paintNow();
    }, STILL));
  }

  focal() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const { across, along } = this.sides["xyz".indexOf(this.camera.up)];
    const tall = along + 0.26 * across; // as seen from a little above
    const pixels = 0.46 * Math.min(width / across, height / tall) * this.radius * this.camera.zoom;
    return [2 * EYE * pixels / Math.max(width, 1), 2 * EYE * pixels / Math.max(height, 1)];
  }

  paintNow(moving = false) {
    try {
      this.paintInto(this.canvas, window.devicePixelRatio || 1, moving);
    } catch (error) {
      complain(error.message);
    }
  }

  // Draw into a canvas, so many pixels to a pixel of the style sheet.
  paintInto(canvas, ratio, moving = false) {
    const width = Math.round(this.canvas.clientWidth * ratio);
    const height = Math.round(this.canvas.clientHeight * ratio);
    const { canvas: from } = openStage(), context = canvas.getContext("2d");
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    if (!width || !height) return;
    if (from.width < width) from.width = width;
    if (from.height < height) from.height = height;
    this.render(stage, width, height, ratio, moving);
    context.clearRect(0, 0, width, height);
    context.drawImage(from, 0, from.height - height, width, height, 0, 0, width, height);
    this.writeLabels(context, ratio);
  }

  render({ gl, mesh: faces, mark: disc }, width, height, ratio, moving) {
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    const { camera, radius } = this, focal = this.focal();
    const share = ({ uniforms }, origin) => { // places count from there: 32 bits hold few digits
      gl.uniformMatrix3fv(uniforms.turn, true, camera.matrix());
      gl.uniform3fv(uniforms.centre, this.centre.map((x, k) => x - origin[k]));
      gl.uniform2fv(uniforms.focal, focal);
      gl.uniform2f(uniforms.pan, camera.x, camera.y);
      gl.uniform1f(uniforms.size, 1 / radius);
    };
    gl.useProgram(faces.made);
    gl.polygonOffset(1, 1); // edges lie in front of the faces
    for (const mesh of this.meshes) {
      const { uniforms } = faces;
      mesh.open(gl);
      share(faces, mesh.origin);
      gl.uniform1f(uniforms.fat, 2 * this.fat / (this.canvas.clientHeight * focal[1]));
      gl.uniform1i(uniforms.paint, this.paint);
      gl.uniform1i(uniforms.grid, this.grid);
      gl.uniform2fv(uniforms.cells, this.cells);
      gl.uniform3fv(uniforms.tint, mesh.tint);
      const few = moving && mesh.faces.length > 3 * MANY_FACES, wire = this.wire && !few;
      if (wire) gl.enable(gl.POLYGON_OFFSET_FILL);
      if (few) mesh.draw(gl, "few", gl.TRIANGLES, () => fewerFaces(mesh, radius / 20));
      else mesh.draw(gl, "all", gl.TRIANGLES, () => mesh.faces);
      gl.disable(gl.POLYGON_OFFSET_FILL);
      if (!wire) continue;
      gl.uniform1i(uniforms.paint, 2);
      gl.uniform3f(uniforms.tint, 0.1, 0.11, 0.13);
      mesh.draw(gl, "edges", gl.LINES, () => edgesOf(mesh.faces));
    }
    gl.useProgram(disc.made);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    share(disc, this.centre);
    for (const { mesh, vertex, tint } of [...this.landmarks, ...this.marks]) {
      if (!mesh.used[vertex]) continue; // it has no place
      const { uniforms } = disc;
      gl.uniform3fv(uniforms.spot, row(mesh.positions, vertex).map((x, k) => x - this.centre[k]));
      gl.uniform3fv(uniforms.tint, tint);
      gl.uniform1f(uniforms.pixels, 17 * ratio);
      for (const [test, strength] of [[gl.LEQUAL, 1], [gl.GREATER, 0.35]]) {
        gl.depthFunc(test);
        gl.uniform1f(uniforms.strength, strength);
        gl.drawArrays(gl.POINTS, 0, 1);
      }
    }
    gl.depthFunc(gl.LEQUAL);
    gl.depthMask(true);
  }

  // The landmarks' labels beside them, within the picture, faint on the far side.
  writeLabels(context, ratio) {
    context.font = `600 ${13 * ratio}px system-ui, sans-serif`;
    context.lineWidth = 3 * ratio;
    context.lineJoin = "round";
    const project = this.projection();
    for (const { mesh, vertex, label } of this.landmarks) {
      const [x, y] = project(...row(mesh.positions, vertex)).map((value) => value * ratio);
      context.globalAlpha = this.facing(mesh, vertex) > HIDDEN ? 1 : 0.35;
      context.strokeStyle = "#fff";
      context.fillStyle = "#111";
      const { width } = context.canvas, last = width - context.measureText(label).width - 3 * ratio;
      const beside = x + 9 * ratio, left = last > 0 && x < width ? Math.min(beside, last) : beside;
      context.strokeText(label, left, y - 8 * ratio);
      context.fillText(label, left, y - 8 * ratio);
    }
    context.globalAlpha = 1;
  }

  // How much a vertex faces the viewer: 1 straight on, below 0 on the far side.
  facing(mesh, vertex) {
    const m = this.camera.matrix(), normal = row(mesh.normals, vertex);
    return m[6] * normal[0] + m[7] * normal[1] + m[8] * normal[2];
  }

  // From a place to pixels from the upper left of the canvas.
  projection() {
    const m = this.camera.matrix(), [fx, fy] = this.focal(), s = 1 / this.radius, { centre, camera } = this;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return (x, y, z) => {
      const a = (x - centre[0]) * s, b = (y - centre[1]) * s, c = (z - centre[2]) * s;
      const w = EYE - (m[6] * a + m[7] * b + m[8] * c);
      const right = (m[0] * a + m[1] * b + m[2] * c) * fx / w + camera.x;
      const up = (m[3] * a + m[4] * b + m[5] * c) * fy / w + camera.y;
      return [(1 + right) * width / 2, (1 - up) * height / 2];
    };
  }

  // The vertex of the first mesh at a place on the page: the nearest corner of the face that is
  // hit first, or the nearest vertex on the screen if that is near.
  vertexAt(clientX, clientY) {
    const mesh = this.meshes[0], box = this.canvas.getBoundingClientRect();
    if (!mesh) return -1;
    const x = 2 * (clientX - box.left) / box.width - 1, y = 1 - 2 * (clientY - box.top) / box.height;
    const m = this.camera.matrix(), [fx, fy] = this.focal(), p = mesh.positions;
    const seen = [(x - this.camera.x) / fx, (y - this.camera.y) / fy, -1];
    const back = ([a, b, c]) => [0, 1, 2].map((i) => m[i] * a + m[3 + i] * b + m[6 + i] * c);
    const eye = back([0, 0, EYE * this.radius]).map((value, i) => value + this.centre[i]);
    const hit = firstHit(p, mesh.faces, eye, back(seen));
    let best = -1, least = Infinity;
    if (hit.face >= 0) {
      for (const corner of mesh.faces.subarray(hit.face, hit.face + 3)) {
        const apart = Math.hypot(...row(p, corner).map((value, k) => value - hit.spot[k]));
        if (apart < least) [best, least] = [corner, apart];
      }
      return best;
    }
    const project = this.projection();
    least = NEAREST;
    for (let i = 0; i < p.length; i += 3) {
      if (!mesh.used[i / 3]) continue;
      const [right, down] = project(p[i], p[i + 1], p[i + 2]);
      const apart = Math.hypot(right - (clientX - box.left), down - (clientY - box.top));
      if (apart < least) [best, least] = [i / 3, apart];
    }
    return best;
  }

  listen() {
    const { canvas } = this, held = new Map();
    let moved = 0;
    canvas.addEventListener("pointerdown", (event) => {
      moved = held.size ? Infinity : 0; // two fingers never click
      held.set(event.pointerId, event);
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before) {
        this.looking ||= requestAnimationFrame(() => {
          this.looking = 0;
          this.pointed(this.vertexAt(event.clientX, event.clientY), false);
        });
        return;
      }
      const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY;
      moved += Math.hypot(dx, dy);
      const other = [...held.values()].find((one) => one.pointerId !== event.pointerId);
      if (other) {
        const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
        this.camera.zoomBy(apart(event) / Math.max(apart(before), 1));
        this.camera.shift(dx / canvas.clientWidth, -dy / canvas.clientHeight); // each finger half
      } else if (event.shiftKey || event.buttons & 2) {
        this.camera.shift(2 * dx / canvas.clientWidth, -2 * dy / canvas.clientHeight);
      } else {
        this.camera.turn(-dx * 0.5, dy * 0.5);
      }
      held.set(event.pointerId, event);
    });
    const release = (event) => {
      const still = moved < (event.pointerType === "touch" ? 12 : 4); // fingers tremble
      const clicked = held.delete(event.pointerId) && still && event.type === "pointerup" && !event.button;
      if (clicked) this.pointed(this.vertexAt(event.clientX, event.clientY), true);
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("pointerleave", () => this.pointed(-1, false));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => this.camera.reset());
    canvas.addEventListener("wheel", (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return; // the page scrolls
      event.preventDefault();
      this.camera.zoomBy(Math.exp(-event.deltaY * 0.0015));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const turns = { ArrowLeft: [10, 0], ArrowRight: [-10, 0], ArrowUp: [0, 10], ArrowDown: [0, -10] };
      if (event.key in turns) {
        const [a, e] = turns[event.key];
        if (event.shiftKey) this.camera.shift(-a / 100, e / 100);
        else this.camera.turn(a, e);
      } else if (event.key === "+" || event.key === "=") this.camera.zoomBy(1.2);
      else if (event.key === "-") this.camera.zoomBy(1 / 1.2);
      else if (event.key === "0" || event.key === "Home") this.camera.reset();
      else return;
      event.preventDefault();
    });
  }
}
