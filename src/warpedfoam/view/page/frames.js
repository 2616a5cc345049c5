// Frames of the trajectory: bytes in the page become typed arrays, when they are asked for.
const KINDS = {
  uint8: Uint8Array, int8: Int8Array, uint16: Uint16Array, int32: Int32Array, float32: Float32Array, float64: Float64Array,
};
const KEPT_BYTES = 256e6; // of unpacked frames

/** Bytes of a base64 text. */
function bytesOf(text) {
  const plain = atob(text), out = new Uint8Array(plain.length);
  for (let k = 0; k < plain.length; k++) out[k] = plain.charCodeAt(k);
  return out;
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}

/** Running sums of differences, row by row. */
function summed(steps, rows) {
  const out = new Int32Array(steps.length), n = steps.length / rows;
  for (let r = 0; r < rows; r++) {
    let value = 0;
    for (let k = r * n; k < (r + 1) * n; k++) out[k] = value += steps[k];
  }
  return out;
}

/** Rows side by side: (a0 a1 …, b0 b1 …) becomes (a0 b0 a1 b1 …). */
function woven(values, rows, Kind) {
  const n = values.length / rows, out = new Kind(values.length);
  for (let r = 0; r < rows; r++) for (let k = 0; k < n; k++) out[k * rows + r] = values[r * n + k];
  return out;
}

/** Bubbles beside each bubble, each once and not itself. */
function neighboursOf(pairs, count) {
  const out = Array.from({ length: count }, () => new Set()), n = pairs.length / 2;
  for (let k = 0; k < n; k++) {
    const a = pairs[k], b = pairs[n + k];
    if (a !== b) out[a].add(b), out[b].add(a);
  }
  return out.map((set) => [...set]);
}

/** Rows of numbers, each four times: one for every corner of the quad that is drawn of a line piece. */
function fourfold(rows, width, Kind) {
  const n = rows.length / width, out = new Kind(4 * rows.length);
  for (let k = 0; k < n; k++) {
    for (let j = 0; j < 4; j++) for (let c = 0; c < width; c++) out[(4 * k + j) * width + c] = rows[k * width + c];
  }
  return out;
}

/** The two ends of each line piece, one row of numbers a piece. */
function ends(values, segments, width, Kind) {
  const n = segments.length / 2, out = new Kind(2 * width * n);
  for (let k = 0; k < n; k++) {
    for (let c = 0; c < width; c++) {
      out[2 * width * k + c] = values[width * segments[k] + c];
      out[2 * width * k + width + c] = values[width * segments[n + k] + c];
    }
  }
  return out;
}

/** Corners of two triangles for each of so many quads. */
function quads(count) {
  const out = new Uint32Array(6 * count), corners = [0, 1, 2, 2, 1, 3];
  for (let k = 0; k < out.length; k++) out[k] = 4 * Math.floor(k / 6) + corners[k % 6];
  return out;
}

/** Points, triangles and line pieces of one degree of detail; made when they are first asked for. */
class Mesh {
  constructor(raw) {
    this.raw = raw;
    this.points = raw.points;
    this.normals = raw.normals;
    this.chunks = { triangles: raw.chunk_triangles, segments: raw.chunk_segments, balls: raw.chunk_balls, cones: raw.chunk_cones };
  }

  get owner() { return (this.kept_owner ??= new Uint32Array(summed(this.raw.owner, 1))); }
  get triangles() { return (this.kept_triangles ??= woven(summed(this.raw.triangles, 3), 3, Uint32Array)); }
  get segments() { return (this.kept_segments ??= summed(this.raw.segments, 2)); }
  // of the four corners of the quad that is drawn of a piece; read once, by the graphics card
  get linePoints() { return fourfold(ends(this.raw.line_points, this.segments, 4, Uint16Array), 8, Uint16Array); }
  get lineNormals() { return fourfold(ends(this.raw.line_normals, this.segments, 4, Int8Array), 8, Int8Array); }
  get beside() { return fourfold(woven(summed(this.raw.beside, 2), 2, Int32Array), 2, Int32Array); }
  get quads() { return quads(this.segments.length / 2); }
}

/** A frame ready to be drawn and read, from its unpacked bytes. */
function frameFrom(buffer, facts) {
  const raw = {}, parts = Array.from({ length: facts.meshes }, () => ({}));
  for (const [name, kind, start, length] of facts.layout) {
    const array = new KINDS[kind](buffer, start, length), [mesh, part] = name.split(":");
    if (mesh.startsWith("mesh")) parts[Number(mesh.slice(4))][part] = array;
    else raw[name] = array;
  }
  const frame = {
    facts,
    ids: raw.ids,
    count: facts.bubbles,
    meshes: parts.map((part) => new Mesh(part)), // finest first
    neighbours: neighboursOf(summed(raw.pairs, 2), facts.bubbles),
    euler: raw.euler,
    targets: raw.targets,
    centres: raw.centres,
    facing: raw.facing,
    values: { id: raw.ids, surface: raw["value:curvature"] },
    rgb: { surface: raw["rgb:curvature"] },
    placeOf: new Map(Array.from(raw.ids, (id, place) => [id, place])),
    bytes: 4 * buffer.byteLength, // with the arrays made of them, about
  };
  for (const name of Object.keys(raw)) {
    const [what, scalar] = name.split(":");
    if (what === "value") frame.values[scalar] = raw[name];
    if (what === "rgb") frame.rgb[scalar] = raw[name];
  }
  return frame;
}

/** Frames by number; those used last are kept unpacked. */
class Frames {
  constructor(facts, textOf) {
    this.facts = facts;
    this.textOf = textOf;
    this.kept = new Map();
  }

  async get(number) {
    let frame = this.kept.get(number);
    if (!frame) frame = frameFrom(await inflated(bytesOf(this.textOf(number))), this.facts.frames[number]);
    this.kept.delete(number);
    this.kept.set(number, frame);
    let bytes = 0;
    for (const item of this.kept.values()) bytes += item.bytes;
    for (const [oldest, item] of this.kept) {
      if (bytes <= KEPT_BYTES || oldest === number) break;
      this.kept.delete(oldest);
      bytes -= item.bytes;
    }
    return frame;
  }
}
