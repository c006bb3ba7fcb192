// A small WebGL 2 viewer: lit meshes, marks on their vertices, and what lies under the pointer.
"use strict";

const NEAREST = 9; // pixels from the pointer within which a vertex off the surface still counts
// Without a graphics processor, larger meshes have fewer faces until nothing moved for so many
// milliseconds.
const MANY_FACES = 20000, STILL = 300;
const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i;

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  ["position", "normal", "place", "value", "known"].forEach((name, i) =>
    gl.bindAttribLocation(made, i, name));
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw Error(gl.getProgramInfoLog(made));
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(made, i);
    uniforms[name] = gl.getUniformLocation(made, name);
  }
  return { made, uniforms };
}

// Azimuth (how far the viewer walks to the shape's left), elevation, zoom and shift. Views that
// share one turn together.
class Camera {
  constructor(azimuth = 50, elevation = 15) {
    this.home = { azimuth, elevation, zoom: 1, x: 0, y: 0 };
    this.up = "y";
    this.views = [];
    this.reset();
  }
  reset() {
    Object.assign(this, this.home);
    this.changed();
  }
  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.max(-90, Math.min(90, this.elevation + elevation));
    this.changed();
  }
  zoomBy(factor) {
    this.zoom = Math.max(0.3, Math.min(40, this.zoom * factor));
    this.changed();
  }
  shift(x, y) {
    this.x += x;
    this.y += y;
    this.changed();
  }
  changed() {
    for (const view of this.views) view.draw();
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

// One canvas. `meshes` are drawn; marks are {spot: [x, y, z], tint}; `pointed(vertex, clicked)` is
// called with the vertex of the first mesh under the pointer, or -1.
class View {
  // `room` is what roomFor says of everything that will be drawn.
  constructor(canvas, camera, room) {
    this.canvas = canvas;
    this.camera = camera;
    Object.assign(this, room);
    this.meshes = [];
    this.marks = [];
    this.fat = 0;
    this.paint = 0;
    this.grid = true;
    this.cells = [14, 10]; // of the grid, along the longest side and the middle one
    this.pointed = () => {};
    const gl = this.gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
    if (!gl) throw Error("This browser shows no WebGL 2, which the pictures need.");
    this.mesh = program(gl, MESH_VERTEX, MESH_FRAGMENT);
    this.mark = program(gl, MARK_VERTEX, MARK_FRAGMENT);
    const told = gl.getExtension("WEBGL_debug_renderer_info");
    this.slow = SOFTWARE.test(gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    camera.views.push(this);
    new ResizeObserver(() => this.draw()).observe(canvas);
    this.listen();
  }

  // positions, faces, and per vertex perhaps place (3), value and known; tint where paint is 2.
  add({ positions, faces, place, value, known, tint = [0.74, 0.77, 0.82] }) {
    const gl = this.gl, n = positions.length / 3;
    const mesh = { positions, faces, tint, buffers: [], array: gl.createVertexArray() };
    gl.bindVertexArray(mesh.array);
    const columns = [
      positions, normalsOf(positions, faces), place || new Float32Array(3 * n),
      value || new Float32Array(n), known || new Float32Array(n).fill(1),
    ];
    columns.forEach((column, i) => {
      mesh.buffers.push(gl.createBuffer());
      gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[i]);
      gl.bufferData(gl.ARRAY_BUFFER, column, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, column.length / n, gl.FLOAT, false, 0, 0);
    });
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.corners = gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(faces), gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.meshes.push(mesh);
    this.draw();
    return mesh;
  }

  // Take all meshes away.
  clear() {
    const { gl } = this;
    for (const mesh of this.meshes) {
      gl.deleteVertexArray(mesh.array);
      for (const buffer of [...mesh.buffers, mesh.corners, mesh.few || null]) gl.deleteBuffer(buffer);
    }
    this.meshes = [];
  }

  addFew(mesh) {
    const { gl } = this, few = fewerFaces(mesh.positions, mesh.faces, this.radius / 20);
    mesh.nFew = few.length;
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, mesh.few = gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, few, gl.STATIC_DRAW);
  }

  set(mesh, column, values) {
    const gl = this.gl, i = ["positions", "normals", "place", "value", "known"].indexOf(column);
    gl.bindBuffer(gl.ARRAY_BUFFER, mesh.buffers[i]);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, values);
    if (column === "positions") {
      mesh.positions = values;
      this.set(mesh, "normals", normalsOf(values, mesh.faces));
    }
    this.draw();
  }

  draw() {
    this.resting = 0;
    if (this.waiting) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      const many = this.slow && this.painted && this.meshes.some(({ faces }) => faces.length > 3 * MANY_FACES);
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
    const { gl, canvas, camera } = this, ratio = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * ratio);
    const height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
    }
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.disable(gl.BLEND);
    const focal = this.focal();
    const share = ({ uniforms }) => {
      gl.uniformMatrix3fv(uniforms.turn, true, camera.matrix());
      gl.uniform3fv(uniforms.centre, this.centre);
      gl.uniform2fv(uniforms.focal, focal);
      gl.uniform2f(uniforms.pan, camera.x, camera.y);
      gl.uniform1f(uniforms.size, 1 / this.radius);
    };
    gl.useProgram(this.mesh.made);
    for (const mesh of this.meshes) {
      const { uniforms } = this.mesh;
      share(this.mesh);
      gl.uniform1f(uniforms.fat, 2 * this.fat / (canvas.clientHeight * focal[1]));
      gl.uniform1i(uniforms.paint, this.paint);
      gl.uniform1i(uniforms.grid, this.grid);
      gl.uniform2fv(uniforms.cells, this.cells);
      gl.uniform3fv(uniforms.tint, mesh.tint);
      gl.bindVertexArray(mesh.array);
      const few = moving && mesh.faces.length > 3 * MANY_FACES;
      if (few && !mesh.few) this.addFew(mesh);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, few ? mesh.few : mesh.corners);
      gl.drawElements(gl.TRIANGLES, few ? mesh.nFew : mesh.faces.length, gl.UNSIGNED_INT, 0);
    }
    gl.bindVertexArray(null);
    gl.useProgram(this.mark.made);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    for (const { spot, tint } of this.marks) {
      const { uniforms } = this.mark;
      share(this.mark);
      gl.uniform3fv(uniforms.spot, spot);
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

  // The vertex of the first mesh at a place on the page: the nearest corner of the face that is
  // hit first, or the nearest vertex on the screen if that is near.
  vertexAt(clientX, clientY) {
    const mesh = this.meshes[0], box = this.canvas.getBoundingClientRect();
    if (!mesh) return -1;
    const x = 2 * (clientX - box.left) / box.width - 1, y = 1 - 2 * (clientY - box.top) / box.height;
    const m = this.camera.matrix(), [fx, fy] = this.focal();
    const seen = [(x - this.camera.x) / fx, (y - this.camera.y) / fy, -1];
    const back = ([a, b, c]) => [0, 1, 2].map((i) => m[i] * a + m[3 + i] * b + m[6 + i] * c);
    const eye = back([0, 0, EYE * this.radius]).map((value, i) => value + this.centre[i]);
    const hit = firstHit(mesh.positions, mesh.faces, eye, back(seen));
    if (hit.face >= 0) {
      let best = -1, least = Infinity;
      for (const corner of mesh.faces.subarray(hit.face, hit.face + 3)) {
        const apart = Math.hypot(...[0, 1, 2].map((i) => mesh.positions[3 * corner + i] - hit.spot[i]));
        if (apart < least) [best, least] = [corner, apart];
      }
      return best;
    }
    let best = -1, least = NEAREST ** 2;
    const p = mesh.positions, s = 1 / this.radius;
    for (let i = 0; i < p.length; i += 3) {
      const a = (p[i] - this.centre[0]) * s, b = (p[i + 1] - this.centre[1]) * s;
      const c = (p[i + 2] - this.centre[2]) * s;
      const w = EYE - (m[6] * a + m[7] * b + m[8] * c);
      const dx = (m[0] * a + m[1] * b + m[2] * c) * fx / w + this.camera.x - x;
      const dy = (m[3] * a + m[4] * b + m[5] * c) * fy / w + this.camera.y - y;
      const apart = (dx * box.width / 2) ** 2 + (dy * box.height / 2) ** 2;
      if (apart < least) [best, least] = [i / 3, apart];
    }
    return best;
  }

  listen() {
    const { canvas } = this, held = new Map();
    let moved = 0;
    canvas.addEventListener("pointerdown", (event) => {
      held.set(event.pointerId, event);
      canvas.setPointerCapture(event.pointerId);
      moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before) {
        if (!this.looking) {
          this.looking = requestAnimationFrame(() => {
            this.looking = 0;
            this.pointed(this.vertexAt(event.clientX, event.clientY), false);
          });
        }
        return;
      }
      const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY;
      moved += Math.hypot(dx, dy);
      const other = [...held.values()].find((one) => one.pointerId !== event.pointerId);
      if (other) {
        const apart = (one) => Math.hypot(one.clientX - other.clientX, one.clientY - other.clientY);
        this.camera.zoomBy(apart(event) / Math.max(apart(before), 1));
      } else if (event.shiftKey || event.buttons & 2) {
        this.camera.shift(2 * dx / canvas.clientWidth, -2 * dy / canvas.clientHeight);
      } else {
        this.camera.turn(-dx * 0.5, dy * 0.5);
      }
      held.set(event.pointerId, event);
    });
    const release = (event) => {
      const clicked = held.delete(event.pointerId) && moved < 4 && event.type === "pointerup";
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
