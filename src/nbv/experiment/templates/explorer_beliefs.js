// What is believed after several views, and where the information gain takes the next one: as
// nbv.core.circle.belief and nbv.core.next_views do it. Tests compare the two.

/** Divide an array by its sum, in place. */
function toSumOne(values) {
  let sum = 0;
  for (let i = 0; i < values.length; i += 1) sum += values[i];
  for (let i = 0; i < values.length; i += 1) values[i] /= sum;
  return values;
}

/** The bin of an angle in degrees. */
const nearestBin = (degrees, bins) => Math.floor((modulo(degrees, 360) / 360) * bins + 0.5) % bins;

/** L in fewer bins: the mean over a bin's viewpoints, the sum over its estimates. */
function coarser(likelihood, bins, few) {
  const width = bins / few, half = (width - 1) / 2, found = new Float64Array(few * few);
  for (let g = 0; g < bins; g += 1) {
    const row = Math.floor(modulo(g + half, bins) / width) * few;
    for (let e = 0; e < bins; e += 1) {
      found[row + Math.floor(modulo(e + half, bins) / width)] += likelihood[g * bins + e] / width;
    }
  }
  const noise = new Float64Array(few);
  for (let g = 0; g < few; g += 1) noise[g] = entropy(found.subarray(g * few, g * few + few));
  // Twice over, every rotation is a run of rows; four rows at a time are summed.
  const twice = new Float64Array((2 * few + 4) * few);
  twice.set(found);
  twice.set(found, few * few);
  return { bins: few, twice, noise };
}

/** Entropy in nats. */
function entropy(probabilities) {
  let sum = 0;
  for (let i = 0; i < probabilities.length; i += 1) {
    if (probabilities[i] > 0) sum -= probabilities[i] * Math.log(probabilities[i]);
  }
  return sum;
}

/** The belief after a first estimate: the row V[e]. */
function firstBelief(table, estimateDeg) {
  const row = nearestBin(estimateDeg, table.bins) * table.bins;
  return table.viewpoint.slice(row, row + table.bins);
}

/** The belief after one view more, `deltaDeg` from the first one, by Bayes' rule. */
function updatedBelief(belief, table, estimateDeg, deltaDeg) {
  const { bins, likelihood } = table;
  const turn = nearestBin(deltaDeg, bins), column = nearestBin(estimateDeg, bins);
  const found = new Float64Array(bins);
  for (let theta = 0; theta < bins; theta += 1) {
    found[theta] = belief[theta] * likelihood[((theta + turn) % bins) * bins + column];
  }
  return toSumOne(found);
}

/** The mean direction of a belief, degrees in [0, 360); null where its directions cancel out. */
function meanDirection(belief) {
  let x = 0, y = 0;
  for (let i = 0; i < belief.length; i += 1) {
    const angle = (2 * Math.PI * i) / belief.length;
    x += belief[i] * Math.cos(angle);
    y += belief[i] * Math.sin(angle);
  }
  // FLAT of nbv.core.circle.distributions.
  if (Math.hypot(x, y) <= 1e-5) return null;
  return modulo((Math.atan2(y, x) * 180) / Math.PI, 360);
}

/** How many degrees the densest directions with 90 % of a belief cover. */
function coveredDeg(belief) {
  const sorted = Float64Array.from(belief).sort();
  let sum = 0, n = 0;
  while (sum < 0.9 && n < sorted.length) {
    n += 1;
    sum += sorted[sorted.length - n];
  }
  return (n * 360) / belief.length;
}

/** Expected entropy of the pose after a next view at each rotation, nats. */
function informationGain(belief, coarse) {
  const { bins, twice, noise } = coarse, width = belief.length / bins, half = (width - 1) / 2;
  const b = new Float64Array(bins + 4), cost = new Float64Array(bins);
  const predicted = new Float64Array(bins);
  for (let i = 0; i < belief.length; i += 1) {
    b[Math.floor(modulo(i + half, belief.length) / width)] += belief[i];
  }
  const prior = entropy(b);
  for (let delta = 0; delta < bins; delta += 1) {
    predicted.fill(0);
    for (let theta = 0; theta < bins; theta += 4) {
      const w0 = b[theta], w1 = b[theta + 1], w2 = b[theta + 2], w3 = b[theta + 3];
      let at0 = (theta + delta) * bins, at1 = at0 + bins, at2 = at1 + bins, at3 = at2 + bins;
      for (let e = 0; e < bins; e += 1) {
        predicted[e] += w0 * twice[at0++] + w1 * twice[at1++] + w2 * twice[at2++] + w3 * twice[at3++];
      }
    }
    let left = prior;
    for (let theta = 0; theta < bins; theta += 1) left += b[theta] * noise[(theta + delta) % bins];
    cost[delta] = left - entropy(predicted);
  }
  return cost;
}

/** How far two directions are apart, degrees in [0, 180]. */
const distanceDeg = (a, b) => Math.abs(modulo(a - b + 180, 360) - 180);

/**
 * The rotation of least expected entropy that keeps its distance from all views so far; of equals
 * the one of smallest travel, then the smaller one. Degrees from the first view.
 */
function nextByGain(belief, coarse, takenDeg, apartDeg) {
  const cost = informationGain(belief, coarse);
  let best = null;
  for (let i = 0; i < coarse.bins; i += 1) {
    const delta = (i * 360) / coarse.bins, travel = distanceDeg(delta, 0);
    if (takenDeg.some((taken) => distanceDeg(taken, delta) < apartDeg)) continue;
    if (best === null || cost[i] < best.cost || (cost[i] === best.cost && travel < best.travel)) {
      best = { delta, travel, cost: cost[i] };
    }
  }
  return best && best.delta;
}

// The opposite view, then the quarters, then the eighths.
const BISECTING_DEG = [180, 90, 270, 45, 225, 135, 315];

/** The first of these views that was not taken yet. */
function nextByHalves(takenDeg) {
  const free = BISECTING_DEG.find((delta) => !takenDeg.includes(delta));
  return free === undefined ? null : free;
}
