"use strict";

// the contact sheet, its filters, and the way between sheet and frames; all state stands in the address
const byId = (id) => document.getElementById(id);
const SORTS = {
  number: ["number", (frame, index) => index],
  turbidity: ["turbidity, clear first", (frame) => frame.attenuation],
  range: ["distance, near first", (frame) => frame.range ?? Infinity],
  blur: ["blur, sharp first", (frame) => frame.blur ?? 0],
};
const FACETS = [
  { key: "turbidity", title: "Turbidity", value: (frame) => frame.turbidity, text: (value) => `c = ${catalogue.turbidities[value]}`, always: true },
  { key: "water", title: "Water", value: (frame) => frame.water },
  { key: "scene", title: "Scene", value: (frame) => frame.scene, always: true },
  { key: "group", title: "Group", value: (frame) => frame.group, always: true },
  { key: "sequence", title: "Sequence", value: (frame) => frame.sequence ?? "none" },
  { key: "camera", title: "Camera", value: (frame) => frame.camera ?? "single" },
  { key: "motion", title: "Motion", value: (frame) => (frame.moves ? "in motion" : "at rest") },
  { key: "markers", title: "Markers", value: (frame) => (frame.markers ? "seen" : "none") },
  { key: "noise", title: "Noise rule", value: (frame) => (frame.noise === null ? "not stated" : frame.noise ? "met" : "not met") },
];
let catalogue = null;
const cards = new Map();
let scrolled = 0;

const state = () => new URLSearchParams(location.hash.slice(1));
const address = (changes) => {
  const next = state();
  for (const [key, value] of Object.entries(changes)) value === null || value === "" ? next.delete(key) : next.set(key, value);
  return `#${next}`;
};

function start(index) {
  catalogue = index;
  byId("facts").append(...index.facts.map(([name, text]) => make("div", {}, make("dt", {}, name), make("dd", {}, text))));
  for (const facet of FACETS) {
    facet.values = [...new Set(index.frames.map(facet.value))].sort((a, b) => (a > b) - (a < b));
    facet.shown = facet.always || facet.values.length > 1;
  }
  for (const frame of index.frames) cards.set(frame.name, card(frame));
  buildFilters();
  addEventListener("hashchange", render);
  addEventListener("keydown", walkByKey);
  history.scrollRestoration = "manual";
  render();
}

function buildFilters() {
  const form = byId("filters");
  const field = (words, control) => make("label", {}, make("span", {}, words), control);
  const go = (key) => (event) => {
    history.replaceState(null, "", address({ [key]: event.target.value }));
    render();
  };
  for (const facet of FACETS.filter((one) => one.shown)) {
    facet.control = make("select", { name: facet.key, change: go(facet.key) });
    form.append(field(facet.title, facet.control));
  }
  const sorts = Object.entries(SORTS).map(([key, [words]]) => make("option", { value: key === "number" ? "" : key }, words));
  form.append(field("Order", make("select", { name: "sort", change: go("sort") }, ...sorts)));
  const views = [["", "as stored"], ["water_free", "without water"]].map(([value, words]) => make("option", { value }, words));
  form.append(field("Pictures", make("select", { name: "view", change: go("view") }, ...views)));
  form.append(field("Frame", make("input", { type: "search", name: "name", placeholder: "part of its name", input: go("name") })));
  form.addEventListener("submit", (event) => event.preventDefault());
}

function card(frame) {
  const size = { width: 240, height: Math.round((240 * frame.height) / frame.width) };
  const image = make("img", { ...size, loading: "lazy", decoding: "async", alt: `Frame ${frame.name}` });
  const blur = frame.blur === null ? "" : `, blur\u00a0${round(frame.blur)}\u00a0px`;
  const words = `${frame.group}; c\u00a0=\u00a0${round(frame.attenuation)}\u00a0/m${blur}`;
  return make("a", { class: "card" }, image, make("b", {}, frame.name), make("span", {}, words));
}

// frames that pass all filters but that of one facet
function passing(now, except = null) {
  const chosen = FACETS.filter((facet) => facet.shown && facet.key !== except && now.has(facet.key));
  const part = (now.get("name") ?? "").toLowerCase();
  return catalogue.frames.filter((frame) =>
    chosen.every((facet) => String(facet.value(frame)) === now.get(facet.key)) && frame.name.toLowerCase().includes(part));
}

function ordered(now) {
  const key = (SORTS[now.get("sort")] ?? SORTS.number)[1];
  const keyed = passing(now).map((frame, index) => [key(frame, index), index, frame]);
  return keyed.sort((a, b) => a[0] - b[0] || a[1] - b[1]).map((entry) => entry[2]);
}

function render() {
  const now = state();
  const name = now.get("frame");
  if (!byId("sheet").hidden) scrolled = scrollY;
  if (name === null) return renderSheet(now);
  return renderFrame(now, name);
}

function renderSheet(now) {
  const frames = ordered(now);
  for (const facet of FACETS.filter((one) => one.shown)) {
    const counts = new Map();
    for (const frame of passing(now, facet.key)) counts.set(facet.value(frame), 1 + (counts.get(facet.value(frame)) ?? 0));
    const options = facet.values.map((value) => {
      const count = counts.get(value) ?? 0;
      return make("option", { value, disabled: !count }, `${facet.text ? facet.text(value) : value} (${count})`);
    });
    facet.control.replaceChildren(make("option", { value: "" }, "all"), ...options);
    facet.control.value = now.get(facet.key) ?? "";
  }
  for (const control of byId("filters").querySelectorAll("[name=sort], [name=view], [name=name]"))
    if (control !== document.activeElement || control.type !== "search") control.value = now.get(control.name) ?? "";
  const file = now.get("view") === "water_free" ? "thumb_water_free" : "thumb";
  for (const frame of frames) {
    const one = cards.get(frame.name);
    const source = `${folderOf(frame.name)}/${file}.webp`;
    if (one.firstChild.getAttribute("src") !== source) one.firstChild.setAttribute("src", source);
    one.href = address({ frame: frame.name });
  }
  byId("cards").replaceChildren(...frames.map((frame) => cards.get(frame.name)));
  const all = catalogue.frames.length;
  byId("count").textContent = frames.length === all ? `${all} frames` : `${frames.length} of ${all} frames`;
  document.title = `uwsim gallery: ${catalogue.name}`;
  const returned = byId("sheet").hidden;
  byId("frame").hidden = true;
  byId("sheet").hidden = false;
  if (returned) scrollTo(0, scrolled);
}

async function renderFrame(now, name) {
  const frames = ordered(now);
  const place = frames.findIndex((frame) => frame.name === name);
  const link = (words, target, kind) => make("a", target ? { href: address({ frame: target.name }), rel: kind } : { "aria-disabled": "true", class: "off" }, words);
  const walk = {
    back: make("a", { href: address({ frame: null, layer: null }), class: "back" }, "All frames"),
    before: link("Previous", place < 0 ? null : frames[place - 1], "prev"),
    after: link("Next", place < 0 ? null : frames[place + 1], "next"),
    place: place < 0 ? "not among the frames chosen" : `${place + 1} of ${frames.length}`,
  };
  const article = byId("frame");
  const entered = article.hidden;
  let content;
  try {
    const frame = await fetchFrame(name);
    const choose = (layer) => {
      history.replaceState(null, "", address({ layer }));
      for (const other of article.querySelectorAll(".walk a[href]")) if (other.rel) other.href = `${address({ frame: frameOf(other) })}`;
    };
    content = framePage(frame, walk, now.get("layer"), choose);
  } catch (error) {
    content = [make("nav", { class: "walk" }, walk.back), make("p", { class: "missing" }, error.message)];
  }
  if (state().get("frame") !== name) return; // left meanwhile
  article.replaceChildren(...content);
  document.title = `Frame ${name} - ${catalogue.name}`;
  byId("sheet").hidden = true;
  article.hidden = false;
  if (entered) scrollTo(0, 0);
}

const frameOf = (link) => new URLSearchParams(link.hash.slice(1)).get("frame");

function walkByKey(event) {
  if (event.altKey || event.ctrlKey || event.metaKey || event.target.matches("input, select, textarea")) return;
  const kind = { ArrowLeft: "a[rel=prev]", ArrowRight: "a[rel=next]", Escape: "a.back" }[event.key];
  if (!byId("frame").hidden && kind) byId("frame").querySelector(kind)?.click();
}

const gallery = { start, receive };
