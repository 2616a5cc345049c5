// Shaders. Colours and states of bubbles sit in a texture, one texel a bubble: red, green, blue, flags.
const PICKED = 1, NEIGHBOUR = 2, CHARGED = 4;
const ROW = 1024; // bubbles in a row of the texture

const COMMON = `#version 300 es
precision highp float;
precision highp int;
precision highp usampler2D;
uniform mat4 u_clip;
uniform vec3 u_low;
uniform float u_side;
uniform vec3 u_eye;
uniform usampler2D u_bubbles;
uvec4 bubble(int place) { return texelFetch(u_bubbles, ivec2(place % ${ROW}, place / ${ROW}), 0); }
`;

// Colours and light are found at the corners of triangles, so that filling them costs little.
const PATCH_VERTEX = `${COMMON}
uniform float u_sink;
uniform vec3 u_light;
uniform bool u_charged;
layout(location = 0) in vec4 a_point;
layout(location = 1) in vec4 a_normal;
layout(location = 2) in uint a_owner;
flat out vec3 v_colour;
flat out float v_pale;
flat out uint v_owner;
out vec2 v_share; // of the colour bar, and the cosine to the light
void main() {
  vec3 p = u_low + u_side * a_point.xyz;
  vec3 n = normalize(a_normal.xyz);
  // what reaches under its neighbours lies below them from both sides
  if (a_normal.w > 0.5) p -= u_sink * (dot(n, u_eye - p) < 0.0 ? -1.0 : 1.0) * n;
  uvec4 texel = bubble(int(a_owner));
  v_pale = u_charged && (texel.a & ${CHARGED}u) == 0u ? 1.0 : 0.0;
  v_colour = mix(vec3(texel.rgb) / 255.0, vec3(0.93), v_pale);
  v_owner = a_owner;
  v_share = vec2(a_point.w, dot(n, u_light));
  gl_Position = u_clip * vec4(p, 1.0);
}`;

// Brightness and the paler backs are those of the pictures that plot_foam draws.
const PATCH_FRAGMENT = `${COMMON}
uniform sampler2D u_ramp;
uniform bool u_by_point; // colours of the surface's points in place of the bubbles'
flat in vec3 v_colour;
flat in float v_pale;
in vec2 v_share;
out vec4 o_colour;
void main() {
  vec3 colour = v_colour;
  if (u_by_point && v_pale == 0.0) colour = texture(u_ramp, vec2((0.5 + 255.0 * v_share.x) / 256.0, 0.5)).rgb;
  float light = v_share.y;
  if (!gl_FrontFacing) {
    colour = mix(vec3(0.62), colour, 0.25);
    light = -light;
  }
  o_colour = vec4(colour * (0.72 + 0.28 * clamp(light, 0.0, 1.0)), 1.0);
}`;

/** Numbers of the bubbles in place of colours: what lies under a finger. */
const PICK_FRAGMENT = `${COMMON}
flat in uint v_owner;
out vec4 o_colour;
void main() {
  uint n = v_owner + 1u;
  o_colour = vec4(float(n & 255u), float((n >> 8) & 255u), float((n >> 16) & 255u), 255.0) / 255.0;
}`;

const LINE_VERTEX = `${COMMON}
uniform vec2 u_half; // half the window, in pixels
uniform float u_width;
uniform float u_dots; // device pixels in a pixel of the page
uniform float u_pull;
uniform bool u_edged;
uniform bool u_films;
uniform bool u_charged;
uniform vec3 u_film;
uniform vec3 u_accent;
layout(location = 0) in vec4 a_tail;
layout(location = 1) in vec4 a_head;
layout(location = 2) in vec4 a_tail_normal;
layout(location = 3) in vec4 a_head_normal;
layout(location = 4) in ivec2 a_beside;
out vec3 v_pixel;
flat out float v_length;
flat out float v_radius;
flat out vec4 v_colour;
void main() {
  vec3 a = u_low + u_side * a_tail.xyz, b = u_low + u_side * a_head.xyz;
  // lines on the far side of a closed surface are behind it
  vec3 ea = u_eye - a, eb = u_eye - b;
  float far_a = length(ea), far_b = length(eb);
  bool away = dot(a_tail_normal.xyz, ea) * far_b + dot(a_head_normal.xyz, eb) * far_a < 0.05 * far_a * far_b;
  if (!u_edged && away) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
  uint flags = bubble(a_beside.x).a;
  if (a_beside.y >= 0) flags |= bubble(a_beside.y).a;
  float width = u_width, pull = u_pull;
  vec3 colour = a_beside.y == -1 ? vec3(0.42, 0.42, 0.45) : u_film;
  bool shown = u_films;
  if (u_charged) {
    if ((flags & ${CHARGED}u) != 0u) width = max(1.5 * width, width + 0.6 * u_dots);
    else { colour = mix(colour, vec3(0.75), 0.75); width = 0.7 * width; pull *= 0.9; }
  }
  if ((flags & ${PICKED}u) != 0u) {
    colour = u_accent; width = max(width, u_dots) + 2.2 * u_dots; pull *= 3.0; shown = true;
  } else if ((flags & ${NEIGHBOUR}u) != 0u) {
    colour = u_accent; width = max(width, u_dots) + 0.4 * u_dots; pull *= 2.0; shown = true;
  }
  if (!shown) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
  // towards the eye: nearer, but in the same place of the picture
  a += (pull / far_a) * ea;
  b += (pull / far_b) * eb;
  vec4 ca = u_clip * vec4(a, 1.0), cb = u_clip * vec4(b, 1.0);
  vec2 pa = ca.xy / ca.w * u_half, pb = cb.xy / cb.w * u_half;
  float len = length(pb - pa);
  vec2 ahead = len > 1e-4 ? (pb - pa) / len : vec2(1.0, 0.0), aside = vec2(-ahead.y, ahead.x);
  float radius = 0.5 * max(width, 1.0), reach = radius + 1.0;
  bool end = (gl_VertexID & 2) != 0;
  float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
  vec4 c = end ? cb : ca;
  vec2 p = (end ? pb + reach * ahead : pa - reach * ahead) + side * reach * aside;
  gl_Position = vec4(p / u_half * c.w, c.z, c.w);
  v_pixel = vec3(end ? len + reach : -reach, side * reach, 1.0) * c.w;
  v_length = len;
  v_radius = radius;
  v_colour = vec4(colour, min(width, 1.0));
}`;

const LINE_FRAGMENT = `${COMMON}
in vec3 v_pixel;
flat in float v_length;
flat in float v_radius;
flat in vec4 v_colour;
out vec4 o_colour;
void main() {
  vec2 p = v_pixel.xy / v_pixel.z;
  float away = length(vec2(p.x - clamp(p.x, 0.0, v_length), p.y));
  float cover = clamp(v_radius + 0.5 - away, 0.0, 1.0) * v_colour.a;
  if (cover <= 0.01) discard;
  o_colour = vec4(v_colour.rgb, cover);
}`;
