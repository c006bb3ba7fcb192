// The one WebGL 2 context of a page. Browsers allow few contexts at a time, and take the oldest ones
// away, so views draw here in turn and copy the picture. A lost context is replaced at the next
// drawing; until then the copies stay.

const COLUMNS = { positions: 3, normals: 3, place: 3, value: 1, known: 1 }; // numbers per vertex
const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i;

let stage = null;

// The context with its programs; another one if it was lost.
function openStage() {
  if (stage && !stage.gl.isContextLost()) return stage;
  const canvas = document.createElement("canvas");
  const gl = canvas.getContext("webgl2", { antialias: true, alpha: true });
  if (!gl) {
    throw Error(stage ? "The browser has closed the graphics of this page. Reload it to turn the shapes."
      : "This browser shows no WebGL 2, which the pictures need.");
  }
  const renderer = gl.getExtension("WEBGL_debug_renderer_info");
  stage = {
    gl, canvas,
    mesh: program(gl, MESH_VERTEX, MESH_FRAGMENT),
    mark: program(gl, MARK_VERTEX, MARK_FRAGMENT),
    slow: SOFTWARE.test(gl.getParameter(renderer ? renderer.UNMASKED_RENDERER_WEBGL : gl.RENDERER)),
  };
  return stage;
}

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  Object.keys(COLUMNS).forEach((name, i) => gl.bindAttribLocation(made, i, name));
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw Error(gl.getProgramInfoLog(made));
  const uniforms = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const { name } = gl.getActiveUniform(made, i);
    uniforms[name] = gl.getUniformLocation(made, name);
  }
  return { made, uniforms };
}

// A mesh on the page, and its copy in the context that is open.
class Surface {
  constructor({ positions, faces, place, value, known, tint = [0.74, 0.77, 0.82] }) {
    const n = positions.length / 3;
    Object.assign(this, {
      positions, faces, tint, normals: normalsOf(positions, faces), place: place || new Float32Array(3 * n),
      value: value || new Float32Array(n), known: known || new Float32Array(n).fill(1),
      origin: row(positions, 0), copy: null, used: new Uint8Array(n),
    });
    for (const vertex of faces) this.used[vertex] = 1;
  }

  // Change a column: positions, place, value or known.
  set(name, values) {
    const changed = { [name]: values };
    if (name === "positions") changed.normals = normalsOf(values, this.faces);
    Object.assign(this, changed);
    const { copy } = this;
    if (!copy || copy.gl.isContextLost()) return;
    for (const one in changed) {
      copy.gl.bindBuffer(copy.gl.ARRAY_BUFFER, copy.buffers[one]);
      copy.gl.bufferSubData(copy.gl.ARRAY_BUFFER, 0, this.packed(one));
    }
  }

  packed(name) {
    return Float32Array.from(this[name], name === "positions" ? (x, i) => x - this.origin[i % 3] : undefined);
  }

  open(gl) {
    if (this.copy?.gl === gl) return;
    this.copy = { gl, array: gl.createVertexArray(), buffers: {} };
    gl.bindVertexArray(this.copy.array);
    Object.entries(COLUMNS).forEach(([name, size], i) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.copy.buffers[name] = gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, this.packed(name), gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(i);
      gl.vertexAttribPointer(i, size, gl.FLOAT, false, 0, 0);
    });
    gl.bindVertexArray(null);
  }

  // Draw the corners that `make` lists, which are kept under a name.
  draw(gl, name, kind, make) {
    const { copy } = this;
    gl.bindVertexArray(copy.array);
    const made = !copy.buffers[name], buffer = copy.buffers[name] ||= gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffer);
    if (made) {
      const corners = make();
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(corners), gl.STATIC_DRAW);
      buffer.size = corners.length;
    }
    gl.drawElements(kind, buffer.size, gl.UNSIGNED_INT, 0);
    gl.bindVertexArray(null);
  }

  close() {
    if (!this.copy) return;
    const { gl, array, buffers } = this.copy;
    gl.deleteVertexArray(array);
    Object.values(buffers).forEach((buffer) => gl.deleteBuffer(buffer));
    this.copy = null;
  }
}
