// What stands beside the picture: legend, numbers of the picked bubble, facts of the frame.
const byId = (id) => document.getElementById(id);
const css = (rgb) => `rgb(${rgb.join(" ")})`;

function element(kind, attributes = {}, ...children) {
  const out = document.createElement(kind);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "class") out.className = value;
    else if (name === "style") out.style.cssText = value;
    else if (name.startsWith("on")) out.addEventListener(name.slice(2), value);
    else out.setAttribute(name, value);
  }
  out.append(...children);
  return out;
}

const signed = (q) => (q > 0 ? `+${q}` : written(q));

/** Values that occur among bubbles, least first: value, bubbles, and the colour of one of them. */
function counted(values, rgb, euler) {
  const found = new Map();
  for (let k = 0; k < values.length; k++) {
    if (euler[k] !== 1) continue;
    const entry = found.get(values[k]) ?? { value: values[k], bubbles: 0, rgb: [...rgb.slice(3 * k, 3 * k + 3)] };
    entry.bubbles += 1;
    found.set(values[k], entry);
  }
  return [...found.values()].sort((a, b) => a.value - b.value);
}

function swatch(rgb, text, more) {
  const box = element("i", { style: `background:${css(rgb)}` });
  return element("span", { class: "swatch" }, box, text, element("small", {}, more));
}

/** The legend of a scalar in a frame. */
function legend(scalar, frame, outside) {
  const parts = [];
  if (scalar.kind === "charge" || scalar.kind === "counted") {
    const row = element("div", { class: "row" });
    for (const { value, bubbles, rgb } of counted(frame.values[scalar.name], frame.rgb[scalar.name], frame.euler)) {
      row.append(swatch(rgb, scalar.kind === "charge" ? signed(value) : written(value), `× ${bubbles}`));
    }
    parts.push(row);
  } else {
    const [low, high] = scalar.limits, one = !(high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high)));
    const stops = one ? [scalar.stops[scalar.stops.length >> 1]] : scalar.stops;
    const colours = stops.length > 1 ? stops.map(css).join(",") : `${css(stops[0])},${css(stops[0])}`;
    // round-off about 0 is 0
    const middle = Math.abs(low + high) < 1e-6 * (high - low) ? 0 : (low + high) / 2;
    const marks = one ? [low] : [low, middle, high];
    const ends = element("div", { class: "ends" }, ...marks.map((x) => element("span", {}, brief(x))));
    parts.push(element("div", { class: "bar", style: `background:linear-gradient(to right,${colours})` }), ends);
  }
  if (frame.euler.some((x) => x !== 1)) parts.push(element("div", { class: "row" }, swatch(outside, "no disk", "")));
  return parts;
}

/** Rows (name, text) of what is known of a bubble. */
function rowsOf(frame, place) {
  const value = (name) => frame.values[name]?.[place];
  const rows = [
    ["sides", written(value("sides"))],
    ["charge", signed(value("charge"))],
    ["area", written(value("area"))],
    ["volume", written(value("volume"))],
    ["target volume", written(frame.targets[place])],
  ];
  if (frame.values.pressure) rows.push(["pressure", written(value("pressure"))]);
  if (frame.values.gap) rows.push(["gap", written(value("gap"))]);
  rows.push(["mean Gaussian curvature", written(value("curvature"))]);
  if (frame.euler[place] !== 1) rows.push(["Euler number", written(frame.euler[place])]);
  return rows;
}

/** Numbers of a bubble, and buttons that lead to its neighbours. */
function numbers(frame, place, go) {
  const table = element("table", {}, element("caption", {}, `Bubble ${frame.ids[place]}`));
  const body = element("tbody");
  for (const [name, text] of rowsOf(frame, place)) {
    body.append(element("tr", {}, element("th", { scope: "row" }, name), element("td", { "data-name": name }, text)));
  }
  table.append(body);
  const ids = frame.neighbours[place].map((k) => frame.ids[k]).sort((a, b) => a - b);
  const links = ids.map((id) =>
    element("button", { type: "button", "aria-label": `Neighbour ${id}`, onclick: () => go(id) }, String(id)));
  return [table, element("p", { class: "hint" }, "Neighbours"), element("div", { class: "links" }, ...links)];
}
