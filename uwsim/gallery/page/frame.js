"use strict";

// one frame: previews are asked for by a script element, for a page on disk may not read files itself
const KEPT = 12;
const received = new Map();
const expected = new Map();
const shown = { axes: true, markers: true, motion: true };

function receive(frame) {
  received.set(frame.name, frame);
  while (received.size > KEPT) received.delete(received.keys().next().value);
  expected.get(frame.name)?.resolve(frame);
}

function fetchFrame(name) {
  if (received.has(name)) return Promise.resolve(received.get(name));
  if (!expected.has(name)) {
    const entry = {};
    entry.promise = new Promise((resolve, reject) => {
      entry.resolve = resolve;
      const asked = make("script", { src: `${folderOf(name)}/frame.js` });
      asked.onload = () => {
        asked.remove();
        if (!received.has(name)) entry.reject();
      };
      entry.reject = () => reject(new Error(`The preview of frame ${name} is missing or broken; run uwsim gallery again.`));
      asked.onerror = entry.reject;
      document.head.append(asked);
    }).finally(() => expected.delete(name));
    expected.set(name, entry);
  }
  return expected.get(name).promise;
}

const folderOf = (name) => `frames/${encodeURIComponent(name)}`;

// the page of a frame; `walk`: {before, after, back, place} as links and words, `chosen`: key of the layer
function framePage(frame, walk, chosen, choose) {
  const layer = frame.layers.find((one) => one.key === chosen) ?? frame.layers[0];
  const stage = make("figure", { class: "stage" });
  const show = (one) => {
    stage.replaceChildren(...staged(frame, one));
  };
  show(layer);
  const layers = switchOf(frame, layer, (one) => {
    show(one);
    choose(one.key);
  });
  const kernel = frame.kernel && frame.blur ? kernelPart(frame) : null;
  return [
    make("nav", { class: "walk", "aria-label": "Frames" }, walk.back, walk.before, walk.after, make("span", {}, walk.place), make("span", { class: "keys-hint" }, "Keys: ← → Esc")),
    make("h2", {}, `Frame ${frame.name}`),
    make("div", { class: "bench" }, stage, make("div", { class: "side" }, layers, togglesOf(frame, stage))),
    make("div", { class: "columns" }, factsTable(frame), make("div", {}, kernel, bodiesTable(frame, stage))),
    make("section", { class: "tree" }, make("h3", {}, "frame.json"), tree("frame.json", frame.json, true)),
  ];
}

function staged(frame, layer) {
  const source = `${folderOf(frame.name)}/${layer.key}.webp`;
  const image = make("img", {
    src: source, width: frame.width, height: frame.height, alt: `Frame ${frame.name}: ${layer.title}`,
    // enlarged pixels stay pixels
    load: () => image.classList.toggle("pixels", image.clientWidth > 1.5 * image.naturalWidth),
    error: () => image.replaceWith(make("p", { class: "missing" }, `${source} is missing`)),
  });
  const picture = make("div", { class: "overlay" }, image, overlay(frame, shown));
  if (layer.gain > 1) picture.append(make("span", { class: "gain" }, `${layer.gain} × brighter`));
  const caption = make("figcaption", {}, make("b", {}, layer.title), ` ${layer.caption}. `);
  caption.append(make("a", { href: source, target: "_blank", rel: "noopener" }, "Open the picture"));
  return [picture, scaleOf(layer), caption].filter(Boolean);
}

function scaleOf(layer) {
  if (layer.low !== undefined) {
    const unit = layer.unit ? ` ${layer.unit}` : "";
    return make("div", { class: "bar" }, make("span", {}, layer.low + unit), make("i", { class: "ramp" }), make("span", {}, layer.high + unit));
  }
  if (layer.longest_px !== undefined)
    return make("div", { class: "bar" }, make("i", { class: "wheel" }), make("span", {}, `full colour: ${layer.longest_px} px and more`));
  return null;
}

function switchOf(frame, layer, pick) {
  const groups = new Map();
  for (const one of frame.layers) groups.set(one.group, [...(groups.get(one.group) ?? []), one]);
  const parts = [...groups].map(([name, members]) => {
    const options = members.map((one) =>
      make("label", {}, make("input", { type: "radio", name: "layer", value: one.key, checked: one.key === layer.key, change: () => pick(one) }), make("span", {}, one.title)));
    return make("div", { class: "chips" }, make("h3", {}, name), ...options);
  });
  return make("fieldset", { class: "switch" }, make("legend", {}, "Layer"), ...parts);
}

function togglesOf(frame, stage) {
  const names = {
    axes: frame.bodies.some((body) => body.axes) || frame.lamps.length ? "Axes of bodies" : null,
    markers: frame.markers.length ? "Markers" : null,
    motion: frame.paths.length ? "Motion during the exposure" : null,
  };
  const options = Object.entries(names).filter(([, words]) => words).map(([name, words]) => {
    const redraw = (event) => {
      shown[name] = event.target.checked;
      stage.querySelector(".overlay svg")?.replaceWith(overlay(frame, shown));
    };
    return make("label", {}, make("input", { type: "checkbox", value: name, checked: shown[name], change: redraw }), make("span", {}, words));
  });
  return options.length ? make("fieldset", { class: "switch" }, make("legend", {}, "Drawn over it"), make("div", { class: "chips" }, ...options)) : null;
}

function kernelPart(frame) {
  const { blur, kernel } = frame;
  const [x, y] = kernel.at;
  const ends = [kernel.path[0], kernel.path[kernel.path.length - 1]];
  const here = Math.hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]);
  const words = ` of the point seen at (${round(x)}, ${round(y)}) px: from start to end (large dot) ${round(here)} px, dots at equal times. ` +
    `In the median of the picture ${round(blur.length_px)} px at ${round(blur.angle_deg)}°, ${blur.uniform ? "the same everywhere" : "not the same everywhere"}.`;
  return make("figure", { class: "blur" }, kernelDrawing(kernel, blur), make("figcaption", {}, make("b", {}, "Blur kernel"), words));
}

function factsTable(frame) {
  const rows = frame.facts.map(([name, text]) => make("tr", {}, make("th", { scope: "row" }, name), make("td", {}, text)));
  return make("div", { class: "scroll" }, make("table", { class: "pairs" }, make("caption", {}, "What it is"), make("tbody", {}, ...rows)));
}

function bodiesTable(frame, stage) {
  const heads = ["body", "kind", "pixels", "x, y, z in the camera's frame [m]"];
  const rows = frame.bodies.map((body) => {
    const mark = (on) => stage.querySelector(`[data-instance="${body.instance}"]`)?.classList.toggle("lit", on);
    const row = make("tr", { mouseenter: () => mark(true), mouseleave: () => mark(false) });
    const swatch = make("i", { class: "swatch" });
    swatch.style.background = rgb(body.colour);
    const share = body.share ? (body.share < 0.001 ? "< 0.1 %" : `${round(100 * body.share, 2)} %`) : "not seen";
    row.append(make("td", {}, swatch, body.name + (body.moves ? " (moves)" : "")), make("td", {}, body.kind));
    row.append(make("td", {}, share), make("td", {}, body.position_m.map((one) => one.toFixed(3)).join(", ")));
    return row;
  });
  const head = make("tr", {}, ...heads.map((text) => make("th", { scope: "col" }, text)));
  const caption = make("caption", {}, "Bodies; the colours are those of the layer Instances, axes x red, y green, z blue");
  return make("div", { class: "scroll" }, make("table", { class: "bodies" }, caption, make("thead", {}, head), make("tbody", {}, ...rows)));
}
