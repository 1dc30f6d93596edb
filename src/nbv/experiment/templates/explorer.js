// What the reader does, and what the page then shows. The state is in the address.

const root = document.documentElement;
const $ = (name) => document.getElementById(name);
const facts = JSON.parse($("facts").textContent);
const { units } = facts;
const methodNamed = (name) => facts.methods.find((method) => method.name === name);
// The method that the paper compares its own with.
const REFERENCE = "opposite";
const MINUS = "\u2212";

const state = { unit: 0, object: 0, view: 0, method: "", views: 2, next: "gain" };
/** What belongs to the object that is shown; null while it is decoded. */
let loaded = null;
let colours = palette();

const text = (value) => (value === null ? "–" : `${value.toFixed(2).replace("-", MINUS)}°`);
const unit = () => units[state.unit];
const stepDeg = () => 360 / unit().views;
const azimuthDeg = () => state.view * stepDeg();
const indexOf = (object, view) => object * unit().views + view;
const here = () => indexOf(state.object, state.view);
const takesTurns = (method) => unit().turns.includes(method.name);
const shownViews = () => (takesTurns(methodNamed(state.method)) ? state.views : 1);

// Decoded once each.
const kept = new Map();
function once(name, make) {
  if (!kept.has(name)) kept.set(name, make());
  return kept.get(name);
}

const outcomesOf = (index) =>
  once(`unit-${index}`, () => unitOutcomes(index, units[index], facts.methods.map((method) => ({
    name: method.name, turns: units[index].turns.includes(method.name),
  }))));

/** The table that a method follows, or that of the first method with one. */
function tablePlace() {
  const criterion = methodNamed(state.method).criterion || facts.criteria[0];
  const fold = unit().folds[state.object];
  return unit().tables.findIndex((one) => one.fold === fold && one.criterion === criterion);
}

async function pictureOf(index, object) {
  if (!units[index].images) return null;
  const picture = new Image();
  picture.src = `data:image/webp;base64,${$(`ring-${index}-${object}`).textContent.trim()}`;
  await picture.decode();
  return picture;
}

async function ownOf(index, object) {
  const of = units[index];
  if (!of.own) return null;
  const fold = of.folds[object];
  const own = await once(`own-${index}-${fold}`, () =>
    ownDistributions(`own-${index}-${fold}`, of.own.classes));
  return { ...own, place: object - of.folds.indexOf(fold) };
}

/** The own distribution of the image nearest to a view, and its azimuth. */
function ownDistribution(azimuth) {
  const { classes, codes, place } = loaded.own;
  const view = Math.round((azimuth / 360) * classes) % classes;
  const start = (place * classes + view) * classes;
  return toSumOne(Float64Array.from(codes.subarray(start, start + classes), (code) => code * code));
}

let latest = 0;

/** Decode what the state needs, then show it. */
async function show({ fromLink = false, entry = false } = {}) {
  latest += 1;
  const ticket = latest, place = tablePlace(), { unit: index, object } = state;
  root.dataset.state = "loading";
  if (!fromLink) $("notice").hidden = true;
  const [outcomes, table, picture, own] = await Promise.all([
    outcomesOf(index),
    once(`table-${index}-${place}`, () =>
      lookupTable(`table-${index}-${place}`, units[index].tables[place])),
    pictureOf(index, object),
    ownOf(index, object),
  ]);
  if (ticket !== latest) return;
  loaded = { outcomes, table, picture, own, facts: unit().tables[place], layer: null };
  fillControls();
  fillObject();
  draw();
  link(entry);
  root.dataset.state = "ready";
}

// The permanent link.

function fragment() {
  return new URLSearchParams({
    category: unit().category,
    elevation: unit().elevation,
    object: unit().objects[state.object],
    azimuth: azimuthDeg(),
    method: state.method,
    views: state.views,
    next: state.next,
  }).toString();
}

function link(entry) {
  const target = `#${fragment()}`;
  if (target === window.location.hash) return;
  if (entry) window.history.pushState(null, "", target);
  else window.history.replaceState(null, "", target);
}

/** Take the state from the address; say what it names that this run does not have. */
function readLink() {
  const asked = new URLSearchParams(window.location.hash.slice(1)), unknown = [];
  const choose = (key, values, fallback) => {
    if (!asked.has(key)) return fallback;
    const place = values.map(String).indexOf(asked.get(key));
    if (place < 0) unknown.push(`${key}=${asked.get(key)}`);
    return place < 0 ? fallback : place;
  };
  const categories = [...new Set(units.map((one) => one.category))];
  const category = categories[choose("category", categories, 0)];
  const own = units.filter((one) => one.category === category);
  const at = own[choose("elevation", own.map((one) => one.elevation), 0)];
  state.unit = units.indexOf(at);
  state.object = choose("object", at.objects, 0);
  const azimuths = Array.from({ length: at.views }, (_, i) => (i * 360) / at.views);
  state.view = choose("azimuth", azimuths, Math.floor(at.views / 4));
  const names = facts.methods.map((method) => method.name);
  const follows = Math.max(0, facts.methods.findIndex((method) => method.criterion));
  state.method = names[choose("method", names, follows)];
  state.views = 1 + choose("views", Array.from({ length: facts.mostViews }, (_, i) => i + 1), 1);
  state.next = ["gain", "halves"][choose("next", ["gain", "halves"], 0)];
  $("notice").hidden = !unknown.length;
  $("notice").textContent = unknown.length
    ? `The link names what this run does not have: ${unknown.join(", ")}. The page shows the nearest it has.`
    : "";
}

// Views and beliefs.

/** Rotations of all views of a method, the first being 0, and the beliefs after each. */
function followed() {
  const { outcomes, table } = loaded, { views } = unit(), n = shownViews();
  const estimateAt = (deltaDeg) =>
    outcomes.estimate[indexOf(state.object, (state.view + Math.round(deltaDeg / stepDeg())) % views)] / 100;
  const turns = [0], estimates = [estimateAt(0)], beliefs = [firstBelief(table, estimates[0])];
  while (turns.length < n) {
    const belief = beliefs[beliefs.length - 1];
    let delta;
    if (turns.length === 1) delta = outcomes.turn[state.method][here()] * stepDeg();
    else if (state.next === "gain") delta = nextByGain(belief, table.coarse, turns, facts.apart);
    else delta = nextByHalves(turns);
    if (delta === null) break;
    turns.push(delta);
    estimates.push(estimateAt(delta));
    beliefs.push(updatedBelief(belief, table, estimates[estimates.length - 1], delta));
  }
  return { turns, estimates, beliefs };
}

// What changes with the object or the unit.

function options(select, values, chosen) {
  select.replaceChildren(...values.map(([value, label]) => new Option(label, value)));
  select.value = String(chosen);
}

function fillControls() {
  const categories = [...new Map(units.map((one) => [one.category, one.label]))];
  options($("category"), categories, unit().category);
  const own = units.filter((one) => one.category === unit().category);
  options($("elevation"), own.map((one) => [one.elevation, `${one.elevation}°`]), unit().elevation);
  const means = unit().means[state.method], label = methodNamed(state.method).label;
  options(
    $("object"),
    unit().objects.map((name, i) => [i, `${name}: ${label} ${text(means[i])}`]),
    state.object,
  );
  document.querySelectorAll("[name=method]").forEach((one) => { one.checked = one.value === state.method; });
  const takes = takesTurns(methodNamed(state.method));
  document.querySelectorAll("[name=views]").forEach((one) => {
    one.checked = Number(one.value) === shownViews();
    one.disabled = !takes && one.value !== "1";
  });
  $("next").value = state.next;
  $("next").disabled = shownViews() < 3;
  const azimuth = $("azimuth");
  azimuth.max = unit().views - 1;
  options($("jump"), jumps().map((one, i) => [i, one.label]), Math.min(Number($("jump").value) || 0, jumps().length - 1));
}

function fillObject() {
  $("unit-text").textContent = `${unit().label}, elevation ${unit().elevation}°`;
  document.querySelectorAll("tr[data-method], .strip").forEach((row) =>
    row.classList.toggle("chosen", row.dataset.method === state.method));
  document.querySelectorAll("#overall tbody tr").forEach((row) => {
    const all = unit().overall[row.dataset.method];
    const cells = {
      object: text(unit().means[row.dataset.method][state.object]),
      mean: text(all.mean),
      above: text(all.above),
      share: `${all.share.toFixed(2)} %`,
    };
    row.querySelectorAll("td").forEach((cell) => { cell.textContent = cells[cell.dataset.cell]; });
  });
  $("why").textContent = difference();
  fillStrips();
  fillScatter();
}

/** The other method of comparisons: Opposite, or for Opposite the first that follows a table. */
function other() {
  const names = facts.methods.map((method) => method.name);
  if (state.method !== REFERENCE && names.includes(REFERENCE)) return methodNamed(REFERENCE);
  return facts.methods.find((method) => method.criterion && method.name !== state.method)
    || facts.methods.find((method) => method.name !== state.method) || facts.methods[0];
}

const signed = (value) => (value > 0 ? "+" : "") + text(value);

/** In words: where the difference of two methods comes from. */
function difference() {
  const mine = methodNamed(state.method), versus = other();
  if (mine === versus) return "";
  const a = unit().overall[mine.name], b = unit().overall[versus.name];
  const gap = a.mean - b.mean, above = a.above - b.above;
  const means = unit().means[mine.name], others = unit().means[versus.name];
  const better = means.filter((mean, i) => mean < others[i]).length;
  const word = gap > 0 ? "above" : "below";
  return `All ${means.length} objects: the mean error of ${mine.label} is ${text(Math.abs(gap))} ${word} that of ${versus.label}: `
    + `${signed(above)} by errors above 90° (often front for back), and ${signed(gap - above)} `
    + `by all others. ${mine.label} is better on ${better} objects.`;
}

const scope = () => document.querySelector("[name=scope]:checked").value;

function stripErrors(name) {
  const errors = loaded.outcomes.error[name], { views, objects } = unit();
  if (scope() === "object") return Array.from(errors.subarray(here() - state.view, here() - state.view + views));
  const sums = new Array(views).fill(0);
  errors.forEach((error, i) => { sums[i % views] += error / objects.length; });
  return sums;
}

function fillStrips() {
  document.querySelectorAll(".strip").forEach((strip) => {
    const errors = stripErrors(strip.dataset.method), worst = errors.indexOf(Math.max(...errors));
    const canvas = strip.querySelector("canvas");
    drawStrip(canvas, errors);
    canvas.setAttribute("aria-label", `Error of ${methodNamed(strip.dataset.method).label} by azimuth of the `
      + `first view; largest ${text(errors[worst])} at ${worst * stepDeg()}°`);
    strip.dataset.worst = worst;
  });
}

let points = [];

function fillScatter() {
  const mine = methodNamed(state.method), versus = other();
  points = drawObjects(
    $("objects"),
    unit().means[mine.name],
    unit().means[versus.name],
    state.object,
    { mine: `${mine.label}: mean error`, others: `${versus.label}: mean error` },
    colourOf(mine, colours),
    colours,
  );
  $("objects").setAttribute("aria-label", `Mean errors of ${points.length} objects by ${mine.label} and by `
    + `${versus.label}. The list of objects has the same numbers.`);
}

// What changes with the view.

function row(cells) {
  const made = document.createElement("tr");
  cells.forEach((content, i) => {
    const cell = document.createElement(i ? "td" : "th");
    if (!i) cell.scope = "row";
    cell.textContent = content;
    made.append(cell);
  });
  return made;
}

const distanceText = (poseDeg) => text(poseDeg === null ? null : distanceDeg(poseDeg, azimuthDeg()));

function fillOutcomes() {
  const { outcomes } = loaded, { views } = unit();
  document.querySelectorAll("#outcomes tbody tr").forEach((line) => {
    const name = line.dataset.method, turn = outcomes.turn[name];
    const second = turn && indexOf(state.object, (state.view + turn[here()]) % views);
    const cells = {
      delta: turn ? `${turn[here()] * stepDeg()}°` : "–",
      next: turn ? text(outcomes.estimate[second] / 100) : "–",
      pose: text(outcomes.pose[name][here()] / 100),
      error: text(outcomes.error[name][here()]),
    };
    line.querySelectorAll("td").forEach((cell) => { cell.textContent = cells[cell.dataset.cell]; });
  });
}

function fillSteps({ turns, estimates, beliefs }) {
  $("steps").tBodies[0].replaceChildren(...turns.map((delta, i) => {
    const mean = meanDirection(beliefs[i]);
    const cells = [
      `${(azimuthDeg() + delta) % 360}°`, text(estimates[i]), `${coveredDeg(beliefs[i])}°`, text(mean), distanceText(mean),
    ];
    return row([String(i + 1), ...cells]);
  }));
}

function drawView(id, azimuth, caption, colour) {
  const box = $(id), { images } = unit(), canvas = box.querySelector("canvas");
  canvas.style.borderColor = colour;
  let shown = "no image";
  if (loaded.picture) {
    const index = nearestImage(azimuth, images);
    shown = `image from ${(index * 360) / images.count}°`;
    canvas.width = canvas.height = images.side;
    drawTile(canvas.getContext("2d"), loaded.picture, images, index, 0, 0, images.side);
  }
  canvas.setAttribute("aria-label", `${unit().objects[state.object]} from azimuth ${azimuth}°, ${shown}`);
  box.querySelector("figcaption").textContent = `${caption} (${shown})`;
}

/** The method whose second view is shown next to the opposite one. */
function recommending() {
  const mine = methodNamed(state.method);
  if (takesTurns(mine) && mine.name !== REFERENCE) return mine;
  return facts.methods.find((method) => method.criterion && takesTurns(method)) || mine;
}

function drawViews({ turns }) {
  const first = azimuthDeg(), shown = recommending();
  const drawTurned = (place, delta, who, method) => {
    const azimuth = (first + delta) % 360;
    drawView(`view-${place}`, azimuth, `${who}: ${delta}° on, from ${azimuth}°`, colourOf(method, colours));
  };
  drawView("view-1", first, `View 1 from ${first}°`, colours.ink);
  drawTurned(2, loaded.outcomes.turn[shown.name][here()] * stepDeg(), shown.label, shown);
  for (let i = 3; i <= facts.mostViews; i += 1) {
    $(`view-${i}`).hidden = i > turns.length;
    if (i <= turns.length) drawTurned(i, turns[i - 1], `View ${i}`, methodNamed(state.method));
  }
  const opposite = methodNamed(REFERENCE);
  drawView("view-opposite", (first + 180) % 360, `Opposite: from ${(first + 180) % 360}°`, opposite ? colourOf(opposite, colours) : colours.line);
}

function drawRing({ turns, beliefs }) {
  const canvas = $("ring"), { context, width } = fitted(canvas);
  const ratio = window.devicePixelRatio || 1, { images } = unit();
  const geometry = ringGeometry(width, images), centre = width / 2;
  if (!loaded.layer || loaded.layerSize !== width * ratio) {
    loaded.layer = ringLayer(width, ratio, loaded.picture, images, geometry, colours);
    loaded.layerSize = width * ratio;
  }
  context.drawImage(loaded.layer, 0, 0, width, width);
  const own = loaded.own && ownDistribution(azimuthDeg());
  drawBeliefs(context, centre, geometry.inner, beliefs, own, colours);
  drawRay(context, centre, azimuthDeg(), geometry.inner, colours.ink, []);
  const mean = meanDirection(beliefs[beliefs.length - 1]);
  if (mean !== null) drawRay(context, centre, mean, geometry.inner, colours.belief, [5, 4]);
  const colour = colourOf(methodNamed(state.method), colours);
  for (let i = turns.length - 1; i >= 0; i -= 1) {
    drawCamera(context, centre, azimuthDeg() + turns[i], geometry.inner + 11, String(i + 1), i ? colour : colours.ink, colours);
  }
  canvas.setAttribute("aria-label", `Ring of views of ${unit().objects[state.object]}, seen from above: first view from `
    + `${azimuthDeg()}°, mean of the belief ${text(mean)}`);
}

function fillCost({ estimates }) {
  const { table, outcomes } = loaded, { bins } = table;
  const start = nearestBin(estimates[0], bins) * bins;
  const cost = table.cost.subarray(start, start + bins);
  const marks = facts.methods
    .filter((method) => takesTurns(method) && [state.method, REFERENCE, recommending().name].includes(method.name))
    .map((method) => ({
      method,
      deltaDeg: outcomes.turn[method.name][here()] * stepDeg(),
      colour: colourOf(method, colours),
      label: method.label[0],
    }));
  const { low, high } = drawCost($("cost"), cost, azimuthDeg(), marks, colours);
  // As many decimals as tell the least from the largest.
  const decimals = Math.min(6, Math.max(2, 1 - Math.floor(Math.log10(Math.max(high - low, 1e-6)))));
  const inUnit = (value) => `${value.toFixed(decimals).replace("-", MINUS)}${table.unit === "1" ? "" : ` ${table.unit}`}`;
  const nothing = table.unit === "nats" ? ` A pose of which nothing is known has ${inUnit(Math.log(bins))}.` : "";
  const criterion = loaded.facts.criterion.replaceAll("_", " ");
  const at = marks.map(({ method, deltaDeg }) =>
    `${method.label[0]} ${method.label} ${inUnit(cost[nearestBin(deltaDeg, bins)])}`).join(", ");
  $("cost-text").textContent = `Cost of a second view from each azimuth, given the estimate ${text(estimates[0])} of `
    + `view 1: ${criterion}, ${inUnit(low)} (inner circle) to ${inUnit(high)} (outer). Nearer to the centre is better. ${at}.${nothing}`;
  $("cost").setAttribute("aria-label", `Cost by azimuth of the second view, ${inUnit(low)} to ${inUnit(high)}: ${at}`);
}

function fillText({ turns, beliefs }) {
  $("azimuth-text").textContent = `${azimuthDeg()}°`;
  $("azimuth").value = state.view;
  $("azimuth").setAttribute("aria-valuetext", `${azimuthDeg()} degrees`);
  $("belief-views").textContent = beliefs.length === 1 ? "one view" : `${beliefs.length} views`;
  $("key-earlier").hidden = turns.length === 1;
  $("key-own").hidden = !loaded.own;
  const part = `${(100 * (state.view + 0.5)) / unit().views}%`;
  document.querySelectorAll(".cursor").forEach((cursor) => { cursor.style.left = part; });
}

/** How long the last frames took, milliseconds. */
const frames = [];

function draw() {
  if (!loaded) return;
  const began = performance.now(), all = followed();
  fillText(all);
  fillOutcomes();
  fillSteps(all);
  drawViews(all);
  drawRing(all);
  fillCost(all);
  frames.push(performance.now() - began);
  if (frames.length > 500) frames.shift();
}

let waiting = false;

function drawSoon() {
  if (waiting) return;
  waiting = true;
  requestAnimationFrame(() => {
    waiting = false;
    draw();
  });
}

// Once a drag is over the address follows, and the change is said aloud.
let settled = null;

function setView(view) {
  state.view = modulo(Math.round(view), unit().views);
  drawSoon();
  clearTimeout(settled);
  settled = setTimeout(() => {
    link(false);
    const { label } = methodNamed(state.method);
    const error = text(loaded.outcomes.error[state.method][here()]);
    $("status").textContent = `First view from ${azimuthDeg()}°: error of ${label} ${error}`;
  }, 250);
}

// Jumps.

/** Every list of first views that one can jump through: object by object, the most extreme first. */
function jumps() {
  const mine = methodNamed(state.method), versus = other();
  const found = [
    { label: `the worst first view of this object (${mine.label})`, by: "error", objects: "this" },
    { label: `the worst first views of all objects (${mine.label})`, by: "error", objects: "all" },
  ];
  if (mine === versus) return found;
  const loses = `${mine.label} loses most to ${versus.label}`;
  return [
    ...found,
    { label: `first views where ${loses}`, by: "loss", objects: "all" },
    { label: `objects on which ${loses} on average`, by: "loss", objects: "mean" },
    { label: `first views where ${mine.label} gains most over ${versus.label}`, by: "gain", objects: "all" },
  ];
}

function ranking({ by, objects }) {
  const mine = loaded.outcomes.error[state.method], versus = loaded.outcomes.error[other().name];
  const sign = by === "gain" ? -1 : 1, { views } = unit();
  const value = (i) => (by === "error" ? mine[i] : sign * (mine[i] - versus[i]));
  const places = objects === "this" ? [state.object] : unit().objects.map((_, i) => i);
  return places
    .map((object) => {
      let worst = 0, sum = 0;
      for (let view = 0; view < views; view += 1) {
        const found = value(indexOf(object, view));
        sum += found;
        if (found > value(indexOf(object, worst))) worst = view;
      }
      return { object, view: worst, key: objects === "mean" ? sum : value(indexOf(object, worst)) };
    })
    .sort((a, b) => b.key - a.key || a.object - b.object);
}

// Where the last jump led, and by which list: the same list once more goes on to its next place.
let jumped = "";

function jump() {
  const list = $("jump").value, ranked = ranking(jumps()[Number(list)]);
  const mark = (one) => [list, state.unit, state.method, one.object, one.view].join(" ");
  const place = (ranked.findIndex((one) => mark(one) === jumped && mark(state) === jumped) + 1) % ranked.length;
  $("rank").textContent = ranked.length > 1 ? `${place + 1} of ${ranked.length}` : "";
  Object.assign(state, { object: ranked[place].object, view: ranked[place].view });
  jumped = mark(state);
  show({ entry: true });
}

// Turning by itself.

let turning = null;

function setTurning(wanted) {
  $("turn").setAttribute("aria-pressed", wanted);
  $("turn").textContent = wanted ? "Stop" : "Rotate";
  if (turning) cancelAnimationFrame(turning);
  turning = null;
  if (!wanted) return;
  const start = performance.now(), from = state.view;
  const go = (now) => {
    setView(from + ((now - start) / 1000) * 24 / stepDeg());
    turning = requestAnimationFrame(go);
  };
  turning = requestAnimationFrame(go);
}

// What the reader does.

function listen() {
  $("controls").addEventListener("submit", (event) => event.preventDefault());
  $("category").addEventListener("change", (event) => {
    const elevation = unit().elevation;
    const own = units.filter((one) => one.category === event.target.value);
    state.unit = units.indexOf(own.find((one) => one.elevation === elevation) || own[0]);
    state.object = 0;
    show({ entry: true });
  });
  $("elevation").addEventListener("change", (event) => {
    const name = unit().objects[state.object], { category } = unit();
    state.unit = units.findIndex((one) => one.category === category && String(one.elevation) === event.target.value);
    state.object = Math.max(0, unit().objects.indexOf(name));
    show({ entry: true });
  });
  $("object").addEventListener("change", (event) => {
    state.object = Number(event.target.value);
    show({ entry: true });
  });
  $("next").addEventListener("change", (event) => {
    state.next = event.target.value;
    show();
  });
  document.querySelectorAll("[name=method]").forEach((one) => one.addEventListener("change", () => {
    state.method = one.value;
    show();
  }));
  document.querySelectorAll("[name=views]").forEach((one) => one.addEventListener("change", () => {
    state.views = Number(one.value);
    show();
  }));
  document.querySelectorAll("[name=scope]").forEach((one) => one.addEventListener("change", fillStrips));
  $("azimuth").addEventListener("input", (event) => setView(Number(event.target.value)));
  $("turn").addEventListener("click", () => setTurning(!turning));
  $("go").addEventListener("click", jump);
  listenToRing();
  document.querySelectorAll(".strip").forEach((strip) => {
    const band = strip.querySelector(".band");
    const follow = (event) => {
      const box = band.getBoundingClientRect();
      setView(Math.min(Math.max(0, Math.floor(((event.clientX - box.left) / box.width) * unit().views)), unit().views - 1));
    };
    onDrag(band, () => true, follow);
    strip.querySelector(".worst").addEventListener("click", () => {
      setView(Number(strip.dataset.worst));
    });
  });
  $("objects").addEventListener("click", (event) => {
    const box = $("objects").getBoundingClientRect();
    const away = points.map(([x, y]) => Math.hypot(x - event.clientX + box.left, y - event.clientY + box.top));
    state.object = away.indexOf(Math.min(...away));
    show({ entry: true });
  });
  const redraw = () => {
    colours = palette();
    sizes.clear();
    if (!loaded) return;
    loaded.layer = null;
    paintSwatches();
    fillScatter();
    drawSoon();
  };
  window.addEventListener("resize", redraw);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  window.addEventListener("hashchange", () => {
    if (window.location.hash.slice(1) === fragment()) return;
    readLink();
    show({ fromLink: true });
  });
}

/** Follow a pointer from where it goes down, if it may start there. */
function onDrag(element, mayStart, follow) {
  let dragged = false;
  element.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !mayStart(event)) return;
    dragged = true;
    setTurning(false);
    element.setPointerCapture(event.pointerId);
    element.classList.add("dragged");
    follow(event);
  });
  element.addEventListener("pointermove", (event) => dragged && follow(event));
  ["pointerup", "pointercancel"].forEach((kind) => element.addEventListener(kind, () => {
    dragged = false;
    element.classList.remove("dragged");
  }));
}

function listenToRing() {
  const ring = $("ring");
  const polar = (event) => {
    const box = ring.getBoundingClientRect();
    const x = event.clientX - box.left - box.width / 2, y = box.top + box.height / 2 - event.clientY;
    return { radius: Math.hypot(x, y) / (box.width / 2), azimuth: Math.atan2(y, x) / DEGREE };
  };
  // The middle and the corners are left to scroll the page by touch.
  const onRing = (event) => {
    const { radius } = polar(event);
    return radius > 0.55 && radius < 1.05;
  };
  onDrag(ring, onRing, (event) => setView(polar(event).azimuth / stepDeg()));
  ring.addEventListener("touchstart", (event) => {
    if (event.touches.length === 1 && onRing(event.touches[0])) event.preventDefault();
  }, { passive: false });
}

function paintSwatches() {
  document.querySelectorAll(".swatch").forEach((swatch) => {
    swatch.style.background = colourOf({ color: swatch.dataset.color }, colours);
  });
}

function drawLegend() {
  const place = (i) => i / 255, errorAt = (part) => 2 * (Math.pow(91, part) - 1);
  drawStrip($("legend").querySelector("canvas"), Array.from({ length: 256 }, (_, i) => errorAt(place(i))));
  $("ticks").replaceChildren(...ERROR_TICKS.map((tick) => {
    const mark = document.createElement("span");
    mark.textContent = `${tick}°`;
    mark.style.left = `${100 * errorPlace(tick)}%`;
    return mark;
  }));
}

// For tests and the console.
window.explorer = { state, followed, frames, loaded: () => loaded };

readLink();
listen();
paintSwatches();
drawLegend();
show({ fromLink: true });
