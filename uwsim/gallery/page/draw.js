"use strict";

// elements from values: text is never markup
const SVG = "http://www.w3.org/2000/svg";

function make(tag, attributes = {}, ...children) {
  return dressed(document.createElement(tag), attributes, children);
}

function draw(tag, attributes = {}, ...children) {
  return dressed(document.createElementNS(SVG, tag), attributes, children);
}

function dressed(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") node.addEventListener(name, value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

const round = (value, digits = 3) => String(Number(value.toPrecision(digits)));
const path = (points) => "M" + points.map((point) => point.join(" ")).join("L");
const rgb = (colour) => `rgb(${colour.join(" ")})`;

// what lies over the picture, in its pixels; `shown`: which of axes, markers, motion
function overlay(frame, shown) {
  // letters of the same size on the page, whatever the width of picture and screen
  const unit = frame.width / (innerWidth < 640 ? 340 : 500);
  const image = draw("svg", { viewBox: `0 0 ${frame.width} ${frame.height}`, "aria-hidden": "true" });
  if (shown.motion) for (const one of frame.paths) image.append(way(one, unit));
  if (shown.markers) for (const marker of frame.markers) image.append(outline(marker, unit));
  if (shown.axes) {
    for (const body of frame.bodies) if (body.axes) image.append(axesOf(body, unit));
    for (const lamp of frame.lamps) image.append(lampMark(lamp, unit));
  }
  return image;
}

function label(text, [x, y], unit, attributes = {}) {
  const place = { x, y, "font-size": 10 * unit, "stroke-width": 2.4 * unit, "text-anchor": "middle" };
  return draw("text", { "dominant-baseline": "middle", ...place, ...attributes }, text);
}

function axesOf(body, unit) {
  const { origin, ends, length_m } = body.axes;
  // what lies behind another body is drawn while its row of the table is pointed at
  const group = draw("g", { class: body.axes.hidden ? "body hidden" : "body", "data-instance": body.instance });
  group.append(draw("title", {}, `${body.name}: axes of ${length_m} m`));
  for (const kind of ["halo", "axis"]) {
    ends.forEach((end, index) => {
      const width = (kind === "halo" ? 3.2 : 1.8) * unit;
      const name = kind === "halo" ? "halo" : "xyz"[index];
      group.append(draw("path", { class: name, d: path([origin, end]), "stroke-width": width, fill: "none" }));
    });
  }
  ends.forEach((end, index) => {
    const beyond = [0, 1].map((k) => origin[k] + 1.16 * (end[k] - origin[k]));
    if (Math.hypot(end[0] - origin[0], end[1] - origin[1]) > 6 * unit)
      group.append(label("xyz"[index], beyond, unit, { class: "xyz"[index] }));
  });
  group.append(label(body.name, [origin[0], origin[1] + 11 * unit], unit, { class: "name" }));
  return group;
}

function outline(marker, unit) {
  const group = draw("g", { class: "marker", "data-id": marker.id });
  group.append(draw("title", {}, `marker ${marker.id} on ${marker.body}`));
  const d = path(marker.corners) + "Z";
  group.append(draw("path", { class: "halo", d, fill: "none", "stroke-width": 2.2 * unit }));
  group.append(draw("path", { class: "corner", d, "stroke-width": 1.1 * unit }));
  marker.corners.forEach(([cx, cy], index) => {
    // the first corner is filled; a corner that is hidden or outside has no ring
    if (marker.visible[index])
      group.append(draw("circle", { class: index ? "corner" : "corner first", cx, cy, r: 2 * unit, "stroke-width": 0.9 * unit }));
  });
  const middle = [0, 1].map((k) => marker.corners.reduce((sum, corner) => sum + corner[k], 0) / 4);
  group.append(label(String(marker.id), middle, unit, { class: "number" }));
  return group;
}

function lampMark(lamp, unit) {
  const [cx, cy] = lamp.at;
  const group = draw("g", { class: "lamp" }, draw("title", {}, `lamp ${lamp.name}`));
  group.append(draw("circle", { class: "corner", cx, cy, r: 4 * unit, "stroke-width": 1.2 * unit }));
  group.append(label(lamp.name, [cx, cy + 10 * unit], unit, { class: "number" }));
  return group;
}

function way(points, unit) {
  const group = draw("g", { class: "way" });
  group.append(draw("path", { class: "halo", d: path(points), fill: "none", "stroke-width": 2.6 * unit }));
  group.append(draw("path", { class: "guess", d: path(points), "stroke-width": 1.2 * unit }));
  const [cx, cy] = points[points.length - 1];
  group.append(draw("circle", { class: "end", cx, cy, r: 1.7 * unit, "stroke-width": 0.7 * unit }));
  return group;
}

// the path of the point at the centre through the exposure, with a dot at equal times
function kernelDrawing(kernel, blur) {
  const points = kernel.path;
  const reach = Math.max(2, ...points.map(([x, y]) => 1.2 * Math.max(Math.abs(x), Math.abs(y) / 0.75)));
  const unit = reach / 60;
  const box = [-reach, -0.75 * reach, 2 * reach, 1.5 * reach].map((value) => round(value, 5)).join(" ");
  const pitch = gridPitch(reach);
  const words = `Path of the point at the centre, ${round(blur.length_px)} px in the median of the picture`;
  const image = draw("svg", { class: "kernel", viewBox: box, role: "img", "aria-label": words });
  const count = Math.floor(reach / pitch);
  for (let k = -count; k <= count; k += 1)
    image.append(draw("path", { class: "rule", d: `M${k * pitch} ${-reach}V${reach}M${-reach} ${k * pitch}H${reach}`, "stroke-width": unit / 2 }));
  image.append(draw("path", { class: "way", d: path(points), "stroke-width": 3 * unit }));
  for (const [cx, cy] of points) image.append(draw("circle", { class: "dot", cx, cy, r: 1.4 * unit }));
  const [cx, cy] = points[points.length - 1];
  image.append(draw("circle", { class: "end", cx, cy, r: 3 * unit }));
  const corner = { x: reach - 2 * unit, y: 0.75 * reach - 2 * unit, "text-anchor": "end", "font-size": 4 * unit };
  image.append(draw("text", corner, `grid ${pitch} px`));
  return image;
}

function gridPitch(reach) {
  const least = Math.max(1, reach / 10);
  const power = 10 ** Math.floor(Math.log10(least) + 1e-9);
  return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= least * (1 - 1e-9));
}

// JSON as a tree that opens; lists of numbers stand in one line
function tree(name, value, open = false) {
  const key = make("b", {}, name);
  if (value === null || typeof value !== "object") return make("div", { class: "leaf" }, key, " ", leafText(value));
  const flat = Array.isArray(value) && value.every((one) => one === null || typeof one !== "object");
  if (flat && value.length <= 6) return make("div", { class: "leaf" }, key, ` [${value.map(leafText).join(", ")}]`);
  const size = Array.isArray(value) ? `[${value.length}]` : `{${Object.keys(value).length}}`;
  const branch = make("details", { open }, make("summary", {}, key, ` ${size}`));
  // filled when it is opened first: spectra and poses are long
  const fill = () => {
    if (branch.childElementCount > 1 || !branch.open) return;
    if (flat) branch.append(make("div", { class: "leaf" }, value.map(leafText).join(", ")));
    else for (const [inner, one] of Object.entries(value)) branch.append(tree(inner, one));
  };
  branch.addEventListener("toggle", fill);
  fill();
  return branch;
}

const leafText = (value) => (typeof value === "string" ? `"${value}"` : typeof value === "number" ? round(value, 7) : String(value));
