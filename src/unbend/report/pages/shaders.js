// What the graphics processor runs: places to the screen, light and colours.

const EYE = 5; // distance of the eye, in radii of what is seen, which reaches from 3 to 7 in depth

// To the screen, from a place in the viewer's axes and radii of what is seen.
const PROJECT = `#version 300 es
uniform mat3 turn;
uniform vec3 centre;
uniform vec2 focal, pan;
uniform float size;
float depth(vec3 p) { return ${EYE}.0 - p.z; }
vec4 project(vec3 p) { return vec4(p.xy * focal + pan * depth(p), 2.5 * depth(p) - 10.5, depth(p)); }
`;

const MESH_VERTEX = `${PROJECT}
uniform float fat;
in vec3 positions, normals, place;
in float value, known;
out vec3 facing, where;
out float amount, sure;
void main() {
  vec3 p = turn * ((positions - centre) * size);
  facing = turn * normals;
  where = place;
  amount = value;
  sure = known;
  gl_Position = project(p + vec3(facing.xy * fat * depth(p), 0)); // fatter, and no nearer
}`;

const MESH_FRAGMENT = `#version 300 es
precision highp float;
uniform int paint;
uniform bool grid;
uniform vec2 cells;
uniform vec3 tint;
in vec3 facing, where;
in float amount, sure;
out vec4 pixel;

vec3 fromLab(vec3 lab) { // Ottosson's OKLab
  vec3 lms = vec3(lab.x + 0.3963377774 * lab.y + 0.2158037573 * lab.z,
                  lab.x - 0.1055613458 * lab.y - 0.0638541728 * lab.z,
                  lab.x - 0.0894841775 * lab.y - 1.2914855480 * lab.z);
  lms = lms * lms * lms;
  vec3 rgb = vec3(dot(vec3(4.0767416621, -3.3077115913, 0.2309699292), lms),
                  dot(vec3(-1.2684380046, 2.6097574011, -0.3413193965), lms),
                  dot(vec3(-0.0041960863, -0.7034186147, 1.7076147010), lms));
  return pow(clamp(rgb, 0.0, 1.0), vec3(1.0 / 2.2));
}

// Along the longest side purple to yellow and dark to light, as colour-blind eyes tell apart too;
// along the middle one lighter, along the shortest another hue.
vec3 ofPlace(vec3 p) {
  vec3 c = clamp(p, 0.0, 1.0);
  float hue = radians(mix(325.0, 85.0, c.x) + 70.0 * (c.z - 0.5));
  float chroma = 0.145;
  return fromLab(vec3(mix(0.60, 0.80, c.x) + 0.20 * (c.y - 0.5), chroma * cos(hue), chroma * sin(hue)));
}

vec3 heat(float t) { // light to dark
  const vec3 c0 = vec3(0.90, 0.93, 0.95), c1 = vec3(0.98, 0.76, 0.38);
  const vec3 c2 = vec3(0.84, 0.37, 0.05), c3 = vec3(0.33, 0.05, 0.12);
  return t < 0.33 ? mix(c0, c1, t / 0.33)
    : t < 0.66 ? mix(c1, c2, (t - 0.33) / 0.33) : mix(c2, c3, (t - 0.66) / 0.34);
}

vec3 bothWays(float t) { // blue below 0, orange above
  vec3 end = t < 0.0 ? vec3(0.0, 0.36, 0.62) : vec3(0.80, 0.33, 0.0);
  return mix(vec3(0.95), end, sqrt(abs(t)));
}

float lines(float x) { // thin lines, as thick on the screen near and far
  float across = fwidth(x);
  float near = abs(fract(x + 0.5) - 0.5);
  return (1.0 - smoothstep(0.6 * across, 1.6 * across, near)) * (1.0 - smoothstep(0.2, 0.5, across));
}

void main() {
  vec3 n = normalize(facing);
  if (n.z < 0.0) n = -n;
  vec3 color = tint;
  if (paint == 0) {
    color = ofPlace(where);
    if (grid) color *= 1.0 - 0.45 * max(lines(where.x * cells.x), lines(where.y * cells.y));
  } else if (paint == 1) {
    color = heat(clamp(amount, 0.0, 1.0));
  } else if (paint == 3) {
    color = bothWays(clamp(amount, -1.0, 1.0));
  } else if (paint == 4) {
    color = where;
  }
  if (paint != 2 && sure < 0.999) color = vec3(0.62);
  vec3 key = normalize(vec3(-0.45, 0.65, 0.62)), fill = normalize(vec3(0.75, 0.1, 0.65));
  float light = 0.42 + 0.14 * n.y + 0.50 * max(dot(n, key), 0.0) + 0.16 * max(dot(n, fill), 0.0);
  light *= 0.66 + 0.34 * n.z; // darker towards the outline: parts stand out
  float shine = 0.10 * pow(max(dot(n, normalize(key + vec3(0, 0, 1))), 0.0), 24.0);
  pixel = vec4(color * light * 1.08 + shine, 1.0);
}`;

const MARK_VERTEX = `${PROJECT}
uniform vec3 spot;
uniform float pixels;
void main() {
  gl_Position = project(turn * ((spot - centre) * size) + vec3(0, 0, 0.012));
  gl_PointSize = pixels;
}`;

const MARK_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 tint;
uniform float strength;
out vec4 pixel;
void main() {
  float r = 2.0 * length(gl_PointCoord - 0.5);
  float edge = fwidth(r);
  float disc = 1.0 - smoothstep(1.0 - edge, 1.0, r);
  vec3 color = mix(tint, vec3(1.0), smoothstep(0.58 - edge, 0.58, r));
  color = mix(color, vec3(0.05), smoothstep(0.84 - edge, 0.84, r));
  pixel = vec4(color, disc * strength);
}`;
