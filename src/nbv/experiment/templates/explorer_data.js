// What the page holds as text becomes arrays again: the other side of nbv.experiment.explorer.

const TURN = 36000; // hundredths of a degree

const modulo = (value, n) => ((value % n) + n) % n;
const halfTurn = (difference) => modulo(difference + TURN / 2, TURN) - TURN / 2;

/** The bytes of a base64 text. */
function bytesOf(name) {
  const text = atob(document.getElementById(name).textContent.trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i += 1) bytes[i] = text.charCodeAt(i);
  return bytes;
}

/** The bytes of a text that was deflated before it was written in base64. */
async function inflated(name) {
  const stream = new Blob([bytesOf(name)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Integers of either sign from a plane of high bytes and one of low bytes. */
function integers(bytes, start, n) {
  const values = new Int32Array(n);
  for (let i = 0; i < n; i += 1) {
    const folded = (bytes[start + i] << 8) | bytes[start + n + i];
    values[i] = folded & 1 ? -((folded + 1) >> 1) : folded >> 1;
  }
  return values;
}

/** Undo differences along both axes of a table (n, n) of bytes, modulo 256. */
function summed(bytes, start, n) {
  const codes = bytes.slice(start, start + n * n);
  for (let row = 0; row < n; row += 1) {
    for (let column = 1; column < n; column += 1) {
      codes[row * n + column] += codes[row * n + column - 1];
    }
  }
  for (let i = n; i < n * n; i += 1) codes[i] += codes[i - n];
  return codes;
}

/** The pose halfway between two estimates, the second one rotated back; whole hundredths. */
function halfway(first, second, turned) {
  return modulo(first + Math.floor(halfTurn(second - turned - first) / 2), TURN);
}

/**
 * A unit's outcomes: estimates, and by method rotations and fused poses, of every first view.
 * Angles are hundredths of a degree, rotations steps from view to view.
 */
async function unitOutcomes(index, unit, methods) {
  const bytes = await inflated(`unit-${index}`);
  const { views } = unit, n = unit.objects.length * views, step = TURN / views;
  const estimate = integers(bytes, 0, n);
  for (let i = 0; i < n; i += 1) {
    const view = i % views;
    if (view) estimate[i] = halfTurn(estimate[i] + estimate[i - 1]);
  }
  for (let i = 0; i < n; i += 1) estimate[i] = modulo(estimate[i] + (i % views) * step, TURN);
  const found = { estimate, turn: {}, pose: {}, error: {} };
  let start = 2 * n;
  for (const { name, turns } of methods) {
    let turn = null;
    if (turns) {
      turn = integers(bytes, start, n);
      start += 2 * n;
    }
    const pose = integers(bytes, start, n), error = new Float32Array(n);
    start += 2 * n;
    for (let i = 0; i < n; i += 1) {
      const view = i % views;
      let expected = estimate[i];
      if (turn) {
        const second = estimate[i - view + ((view + turn[i]) % views)];
        expected = halfway(estimate[i], second, turn[i] * step);
      }
      pose[i] = modulo(expected + pose[i], TURN);
      error[i] = Math.abs(halfTurn(pose[i] - view * step)) / 100;
    }
    Object.assign(found.turn, { [name]: turn });
    Object.assign(found.pose, { [name]: pose });
    Object.assign(found.error, { [name]: error });
  }
  return found;
}

/** A lookup table: L[viewpoint, estimate], V[estimate, viewpoint] and the cost A[estimate, delta]. */
async function lookupTable(name, facts) {
  const bytes = await inflated(name), { bins } = facts, size = bins * bins;
  const codes = summed(bytes, 0, bins), costCodes = summed(bytes, size, bins);
  const likelihood = new Float64Array(size), viewpoint = new Float64Array(size);
  const cost = new Float64Array(size);
  for (let i = 0; i < size; i += 1) {
    likelihood[i] = Math.exp(facts.low + codes[i] * ((facts.high - facts.low) / 255));
    cost[i] = facts.costLow + costCodes[i] * ((facts.costHigh - facts.costLow) / 255);
  }
  for (let row = 0; row < bins; row += 1) toSumOne(likelihood.subarray(row * bins, row * bins + bins));
  for (let e = 0; e < bins; e += 1) {
    for (let g = 0; g < bins; g += 1) viewpoint[e * bins + g] = likelihood[g * bins + e];
    toSumOne(viewpoint.subarray(e * bins, e * bins + bins));
  }
  return { bins, likelihood, viewpoint, cost, unit: facts.unit, coarse: coarser(likelihood, bins, facts.coarse) };
}

/** A classifier's distributions of one fold's images: bytes (object, class of azimuth, class). */
async function ownDistributions(name, classes) {
  return { classes, codes: await inflated(name) };
}
