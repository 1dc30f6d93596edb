// Canvases: the ring of views, the cost, single views, strips of errors, objects. Azimuth 0 is on
// the right and azimuths increase counter-clockwise, as seen from above, as in all figures.

const DEGREE = Math.PI / 180;

/** The colours of the page's style as they are now: light or dark. */
function palette() {
  const style = getComputedStyle(document.documentElement);
  const names = ["ink", "muted", "line", "paper", "belief", "own", "tile"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** A method's colour; black ink is white on a dark page. */
const colourOf = (method, colours) => (method.color === "#000000" ? colours.ink : method.color);

// Asking for a size in the middle of a frame would make the browser lay out the page again.
const sizes = new Map();

/** Fit a canvas to its place on the page and to the screen's pixels; its context and CSS size. */
function fitted(canvas) {
  const ratio = window.devicePixelRatio || 1;
  if (!sizes.has(canvas)) sizes.set(canvas, [canvas.clientWidth, canvas.clientHeight]);
  const [width, height] = sizes.get(canvas);
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/** The point at an azimuth and a radius from a centre. */
const at = (centre, azimuthDeg, radius) => [
  centre + radius * Math.cos(azimuthDeg * DEGREE),
  centre - radius * Math.sin(azimuthDeg * DEGREE),
];

/** Draw one image of a picture of many into a square. */
function drawTile(context, picture, images, index, x, y, side) {
  const column = index % images.columns, row = Math.floor(index / images.columns);
  context.drawImage(
    picture,
    column * images.side, row * images.side, images.side, images.side,
    x, y, side, side,
  );
}

/** The image nearest to an azimuth. */
const nearestImage = (azimuthDeg, images) =>
  Math.round((azimuthDeg / 360) * images.count) % images.count;

/** Where the ring's images and the circle inside them lie. */
function ringGeometry(size, images) {
  if (!images) return { every: 0, tile: 0, ringRadius: size / 2 - 14, inner: size / 2 - 30 };
  const tile = Math.max(34, size * 0.078);
  const ringRadius = size / 2 - tile * 0.62;
  const fit = Math.floor((2 * Math.PI * ringRadius) / tile);
  let every = 1;
  while (images.count / every > fit || images.count % every) every += 1;
  return { every, tile, ringRadius, inner: ringRadius - tile * 0.5 - 22 };
}

/** The images all round, drawn once for each object and size. */
function ringLayer(size, ratio, picture, images, geometry, colours) {
  const layer = document.createElement("canvas");
  layer.width = layer.height = Math.round(size * ratio);
  const context = layer.getContext("2d");
  context.scale(ratio, ratio);
  const { every, tile, ringRadius, inner } = geometry;
  if (picture) {
    for (let index = 0; index < images.count; index += every) {
      const [x, y] = at(size / 2, (index * 360) / images.count, ringRadius);
      context.fillStyle = colours.tile;
      context.fillRect(x - tile / 2, y - tile / 2, tile, tile);
      drawTile(context, picture, images, index, x - tile / 2, y - tile / 2, tile);
    }
  }
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  for (const part of [1, Math.SQRT1_2, 0.5]) {
    context.beginPath();
    context.arc(size / 2, size / 2, inner * part, 0, 2 * Math.PI);
    context.stroke();
  }
  context.fillStyle = colours.muted;
  context.font = "12px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (let azimuth = 0; azimuth < 360; azimuth += 90) {
    context.beginPath();
    context.moveTo(size / 2, size / 2);
    context.lineTo(...at(size / 2, azimuth, inner));
    context.stroke();
    const [x, y] = at(size / 2, azimuth + 7, inner - 12);
    context.fillText(`${azimuth}°`, x, y);
  }
  return layer;
}

/** The outline of values round the circle. */
function polarPath(context, centre, radii) {
  context.beginPath();
  for (let i = 0; i < radii.length; i += 1) {
    const [x, y] = at(centre, (i * 360) / radii.length, radii[i]);
    if (i) context.lineTo(x, y);
    else context.moveTo(x, y);
  }
  context.closePath();
}

/** Radii of a distribution: square roots, so that areas are probabilities. */
function beliefRadii(belief, densest, radius) {
  return Array.from(belief, (p) => radius * Math.sqrt((p * belief.length) / densest));
}

function drawBeliefs(context, centre, radius, beliefs, own, colours) {
  const densities = [...beliefs, ...(own ? [own] : [])];
  const densest = Math.max(...densities.map((one) => one.reduce((a, b) => Math.max(a, b)) * one.length));
  beliefs.forEach((belief, view) => {
    polarPath(context, centre, beliefRadii(belief, densest, radius));
    const last = view === beliefs.length - 1;
    if (last) {
      context.globalAlpha = 0.32;
      context.fillStyle = colours.belief;
      context.fill();
      context.globalAlpha = 1;
    }
    context.strokeStyle = last ? colours.belief : colours.muted;
    context.lineWidth = last ? 2 : 1;
    context.setLineDash(last ? [] : [2, 3]);
    context.stroke();
  });
  if (own) {
    polarPath(context, centre, beliefRadii(own, densest, radius));
    context.strokeStyle = colours.own;
    context.lineWidth = 2;
    context.setLineDash([6, 3]);
    context.stroke();
  }
  context.setLineDash([]);
}

function drawRay(context, centre, azimuthDeg, radius, colour, dash) {
  context.beginPath();
  context.moveTo(centre, centre);
  context.lineTo(...at(centre, azimuthDeg, radius));
  context.strokeStyle = colour;
  context.lineWidth = 1.75;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
}

/** A numbered camera on the ring. */
function drawCamera(context, centre, azimuthDeg, radius, label, fill, colours) {
  const [x, y] = at(centre, azimuthDeg, radius);
  context.beginPath();
  context.arc(x, y, 11, 0, 2 * Math.PI);
  context.fillStyle = fill;
  context.fill();
  context.lineWidth = 2;
  context.strokeStyle = colours.paper;
  context.stroke();
  context.fillStyle = readableOn(fill);
  context.font = "bold 13px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillText(label, x, y + 0.5);
}

/** Black or white, whichever has more contrast with a colour. */
function readableOn(colour) {
  const parts = colour.match(/[\da-f]{2}/gi).map((hex) => {
    const part = parseInt(hex, 16) / 255;
    return part <= 0.03928 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4;
  });
  const luminance = 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2];
  return luminance > 0.179 ? "#000000" : "#ffffff";
}

/** Cost against the camera's azimuth after the rotation: the least lies nearest to the centre. */
function drawCost(canvas, cost, firstDeg, marks, colours) {
  const { context, width } = fitted(canvas);
  const centre = width / 2, radius = width / 2 - 32, inner = radius * 0.28;
  const low = cost.reduce((a, b) => Math.min(a, b)), high = cost.reduce((a, b) => Math.max(a, b));
  const radiusOf = (value) => inner + (radius - inner) * (high > low ? (value - low) / (high - low) : 0);
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  for (const part of [inner, (inner + radius) / 2, radius]) {
    context.beginPath();
    context.arc(centre, centre, part, 0, 2 * Math.PI);
    context.stroke();
  }
  context.fillStyle = colours.muted;
  context.font = "12px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (let azimuth = 0; azimuth < 360; azimuth += 90) {
    context.fillText(`${azimuth}°`, ...at(centre, azimuth, radius + (azimuth % 180 ? 20 : 17)));
  }
  const n = cost.length;
  context.beginPath();
  for (let i = 0; i <= n; i += 1) {
    const [x, y] = at(centre, firstDeg + (i * 360) / n, radiusOf(cost[i % n]));
    if (i) context.lineTo(x, y);
    else context.moveTo(x, y);
  }
  context.strokeStyle = colours.ink;
  context.lineWidth = 1.75;
  context.stroke();
  drawCamera(context, centre, firstDeg, radius, "1", colours.ink, colours);
  for (const { deltaDeg, colour, label } of marks) {
    const value = cost[nearestBin(deltaDeg, n)];
    drawCamera(context, centre, firstDeg + deltaDeg, radiusOf(value), label, colour, colours);
  }
  return { low, high };
}

// Errors: light to dark, so that grey print keeps the order; logarithmic, for most are small.
const ERROR_STOPS = ["#fff6df", "#fdc673", "#e8762c", "#982b06", "#260800"].map((hex) =>
  [1, 3, 5].map((start) => parseInt(hex.slice(start, start + 2), 16)));
const errorPlace = (errorDeg) => Math.log(1 + errorDeg / 2) / Math.log(91);

function errorColour(errorDeg) {
  const place = Math.min(1, errorPlace(errorDeg)) * (ERROR_STOPS.length - 1);
  const below = Math.min(Math.floor(place), ERROR_STOPS.length - 2), part = place - below;
  return ERROR_STOPS[below].map((c, i) => Math.round(c + part * (ERROR_STOPS[below + 1][i] - c)));
}

/** One pixel for each value. */
function drawStrip(canvas, errorsDeg) {
  canvas.width = errorsDeg.length;
  canvas.height = 1;
  const context = canvas.getContext("2d"), pixels = context.createImageData(errorsDeg.length, 1);
  errorsDeg.forEach((error, i) => pixels.data.set([...errorColour(error), 255], 4 * i));
  context.putImageData(pixels, 0, 0);
}

const ERROR_TICKS = [0, 2, 5, 10, 20, 45, 90, 180];
const MEAN_TICKS = [0, 0.5, 1, 2, 3, 5, 7, 10, 15, 20, 30, 45, 60, 90, 120];

/** Each object's mean errors by two methods; points above the diagonal are where `other` wins. */
function drawObjects(canvas, mine, others, chosen, labels, colour, colours) {
  const { context, width } = fitted(canvas);
  const left = 44, bottom = 42, top = 10, right = 10, size = width - left - right;
  const places = [...mine, ...others].map(errorPlace);
  const least = Math.max(0, Math.min(...places) - 0.03), most = Math.min(1, Math.max(...places) + 0.03);
  const part = (error) => ((errorPlace(error) - least) / (most - least)) * size;
  const x = (error) => left + part(error), y = (error) => top + size - part(error);
  context.font = "12px system-ui, sans-serif";
  context.lineWidth = 1;
  let last = -Infinity;
  for (const tick of MEAN_TICKS) {
    const place = errorPlace(tick);
    if (place < least || place > most || part(tick) - last < 30) continue;
    last = part(tick);
    context.strokeStyle = colours.line;
    context.beginPath();
    context.moveTo(x(tick), top);
    context.lineTo(x(tick), top + size);
    context.moveTo(left, y(tick));
    context.lineTo(left + size, y(tick));
    context.stroke();
    context.fillStyle = colours.muted;
    context.textAlign = "center";
    context.textBaseline = "top";
    context.fillText(`${tick}°`, x(tick), top + size + 5);
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.fillText(`${tick}°`, left - 5, y(tick));
  }
  context.strokeStyle = colours.muted;
  context.setLineDash([4, 3]);
  context.beginPath();
  context.moveTo(left, top + size);
  context.lineTo(left + size, top);
  context.stroke();
  context.setLineDash([]);
  context.fillStyle = colours.ink;
  context.textAlign = "center";
  context.textBaseline = "bottom";
  context.fillText(labels.others, left + size / 2, top + size + bottom - 4);
  context.save();
  context.translate(12, top + size / 2);
  context.rotate(-Math.PI / 2);
  context.fillText(labels.mine, 0, 2);
  context.restore();
  const points = mine.map((error, i) => [x(others[i]), y(error)]);
  points.forEach(([px, py], i) => {
    if (i === chosen) return;
    context.beginPath();
    context.arc(px, py, 4, 0, 2 * Math.PI);
    context.globalAlpha = 0.55;
    context.fillStyle = colour;
    context.fill();
    context.globalAlpha = 1;
  });
  const [px, py] = points[chosen];
  context.beginPath();
  context.arc(px, py, 7, 0, 2 * Math.PI);
  context.fillStyle = colour;
  context.fill();
  context.lineWidth = 3;
  context.strokeStyle = colours.ink;
  context.stroke();
  return points;
}
