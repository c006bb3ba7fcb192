// What is computed of places and faces: normals, fewer faces, edges, the face along a ray.

function normalsOf(positions, faces) {
  const normals = new Float32Array(positions.length);
  for (let f = 0; f < faces.length; f += 3) {
    const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
    const ux = positions[b] - positions[a], vx = positions[c] - positions[a];
    const uy = positions[b + 1] - positions[a + 1], vy = positions[c + 1] - positions[a + 1];
    const uz = positions[b + 2] - positions[a + 2], vz = positions[c + 2] - positions[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (const i of [a, b, c]) {
      normals[i] += x;
      normals[i + 1] += y;
      normals[i + 2] += z;
    }
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
    normals[i] /= length;
    normals[i + 1] /= length;
    normals[i + 2] /= length;
  }
  return normals;
}

// Faces between one vertex of each cell of a grid, of those that face alike.
function fewerFaces({ positions, normals, faces }, cell) {
  const first = new Map(), stands = new Uint32Array(positions.length / 3);
  const whole = (value) => Math.round(value / cell) & 1023;
  for (let i = 0; i < stands.length; i++) {
    const k = 3 * i, way = [0, 1, 2].reduce((sum, j) => 2 * sum + (normals[k + j] > 0), 0);
    const place = [0, 1, 2].reduce((sum, j) => 1024 * sum + whole(positions[k + j]), way);
    if (!first.has(place)) first.set(place, i);
    stands[i] = first.get(place);
  }
  const kept = [];
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [stands[faces[f]], stands[faces[f + 1]], stands[faces[f + 2]]];
    if (a !== b && b !== c && c !== a) kept.push(a, b, c);
  }
  return new Uint32Array(kept);
}

// Both ends of every side of every face.
function edgesOf(faces) {
  const ends = new Uint32Array(2 * faces.length);
  for (let f = 0; f < faces.length; f += 3) {
    ends.set([faces[f], faces[f + 1], faces[f + 1], faces[f + 2], faces[f + 2], faces[f]], 2 * f);
  }
  return ends;
}

// The first face along a ray (Möller and Trumbore, 1997), by the place of its first corner.
function firstHit(positions, faces, eye, way) {
  let face = -1, nearest = Infinity;
  const [ox, oy, oz] = eye, [dx, dy, dz] = way;
  for (let f = 0; f < faces.length; f += 3) {
    const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
    const ax = positions[a], ay = positions[a + 1], az = positions[a + 2];
    const ux = positions[b] - ax, uy = positions[b + 1] - ay, uz = positions[b + 2] - az;
    const vx = positions[c] - ax, vy = positions[c + 1] - ay, vz = positions[c + 2] - az;
    const px = dy * vz - dz * vy, py = dz * vx - dx * vz, pz = dx * vy - dy * vx;
    const det = ux * px + uy * py + uz * pz;
    if (det === 0) continue;
    const tx = ox - ax, ty = oy - ay, tz = oz - az;
    const s = (tx * px + ty * py + tz * pz) / det;
    if (s < 0 || s > 1) continue;
    const qx = ty * uz - tz * uy, qy = tz * ux - tx * uz, qz = tx * uy - ty * ux;
    const t = (dx * qx + dy * qy + dz * qz) / det;
    if (t < 0 || s + t > 1) continue;
    const along = (vx * qx + vy * qy + vz * qz) / det;
    if (along > 0 && along < nearest) [face, nearest] = [f, along];
  }
  return { face, spot: [ox + nearest * dx, oy + nearest * dy, oz + nearest * dz] };
}
