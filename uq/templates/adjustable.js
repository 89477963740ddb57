// A table of sources whose figures can be changed, and what the law of propagation makes of them: 3σ and mean error by
// source and component. The numbers are those of uq/analysis/propagation/adjustable_law.py, where the equations stand.

const POINTS = 4; // of the interpolation between levels of the gyro's noise

function weights(levels, level) {
  const at = levels.map(Math.log), x = Math.min(Math.max(Math.log(level), at[0]), at.at(-1));
  const above = at.findIndex((node) => node > x);
  const first = Math.min(Math.max((above < 0 ? at.length : above) - POINTS / 2, 0), at.length - POINTS);
  const near = at.slice(first, first + POINTS);
  const all = at.map(() => 0);
  near.forEach((node, k) => {
    all[first + k] = near.reduce((w, other, j) => (j === k ? w : (w * (x - other)) / (node - other)), 1);
  });
  return all;
}

// Between levels the logarithm is interpolated, which follows a dilution over decades; where the sign changes, the value.
function between(values, w) {
  const sign = Math.sign(values[0]);
  if (values.some((value) => Math.sign(value) !== sign || value === 0)) return values.reduce((sum, v, k) => sum + w[k] * v, 0);
  return sign * Math.exp(values.reduce((sum, value, k) => sum + w[k] * Math.log(Math.abs(value)), 0));
}

// How a part follows the motion's duration or amplitude: a parabola of logarithms.
function followed(motion, kind, source, component, factors) {
  return Object.entries(motion ?? {}).reduce((product, [name, powers]) => {
    const [first, second] = powers[kind][source][component], log = Math.log(factors[name] ?? 1);
    return product * Math.exp(first * log + second * log * log);
  }, 1);
}

// Each source's variance [(g·m²)²] and mean error [g·m²] by component, then those of all together.
export function evaluate(law, state) {
  const pair = law.pairs[state.pair], s = state.factors;
  const noise = pair.gyro.reduce((sum, share, i) => sum + share * s[i] ** 2, 0);
  const w = weights(law.levels, noise || law.levels[0]);
  const parts = law.sources.map((_, i) => law.components.map((_, a) => {
    const square = s[i] ** 2, gyro = pair.gyro[i] * square;
    const at = (name) => between(pair[name].map((level) => level[i][a]), w);
    const shared = (name) => gyro && gyro * between(pair[name].map((level) => level[a]), w);
    const variance = square * at("first") + square ** 2 * at("second") + shared("gyroVariance");
    const mean = square * at("mean") + shared("gyroMean");
    return {
      variance: variance * followed(pair.motion, "variance", i, a, state),
      mean: mean * followed(pair.motion, "mean", i, a, state) + pair.expected[i][a],
    };
  }));
  const total = law.components.map((_, a) => {
    let variance = 0, mean = pair.rest[a];
    for (const part of parts) { variance += part[a].variance; mean += part[a].mean; }
    for (const [i, j, first, second, shift] of pair.joint) {
      const both = s[i] * s[j];
      variance += both * first[a] + both ** 2 * second[a];
      mean += both * shift[a];
    }
    return { variance, mean };
  });
  const bar = ({ variance, mean }) => ({ spread: 3 * Math.sqrt(Math.max(variance, 0)), mean });
  return { total: total.map(bar), sources: parts.map((part) => part.map(bar)) };
}

function made(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name in element) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

const rounded = (value) => String(Number(value.toPrecision(4)));
function shown(value) {
  const size = Math.abs(value);
  const text = size < 5e-5 ? "0" : size < 0.1 ? value.toFixed(4) : size < 1000 ? value.toPrecision(3) : value.toFixed(0);
  return text.replace("-", "−");
}

export function stated(law) {
  return { pair: 0, factors: law.sources.map(() => 1), duration: 1, amplitude: 1 };
}

// Build the table in an element; `changed(state)` hears of every change. Returns a function that puts it in a state.
export function adjustable(place, law, changed = () => {}) {
  const state = stated(law), inputs = [], cells = new Map(), motions = [];
  const first = evaluate(law, state);

  function cell(row, a) {
    const line = (kind) => {
      const bar = made("i", { className: kind }), text = made("span");
      return [made("div", {}, made("b", {}, bar), text), bar, text];
    };
    const [spread, spreadBar, spreadText] = line("spread"), [mean, meanBar, meanText] = line("mean");
    cells.set(`${row} ${a}`, { spreadBar, spreadText, meanBar, meanText });
    return made("td", { className: "parts" }, spread, mean);
  }

  function follow() { redraw(); changed({ ...state, factors: [...state.factors] }); }

  function row(source, i) {
    const name = source.name.replaceAll("_", " "), axes = source.axes > 1 ? ", largest axis" : "";
    const about = `${source.what} of ${name} in ${source.unit}${axes}`, fixed = !source.figure;
    const number = made("input", { type: "number", min: 0, max: 10 * source.figure, step: "any", disabled: fixed, "aria-label": about });
    const range = made("input", { type: "range", min: -1, max: 1, step: 0.01, disabled: fixed, "aria-label": `factor on ${about}` });
    number.addEventListener("input", () => {
      const value = number.valueAsNumber;
      if (!(value >= 0)) return;
      state.factors[i] = Math.min(value / source.figure, 10);
      follow();
    });
    number.addEventListener("change", () => redraw(true));
    range.addEventListener("input", () => { state.factors[i] = 10 ** range.valueAsNumber; follow(); });
    inputs.push({ number, range, source, row: null });
    const title = made("span", { className: "name", title: source.group.replaceAll("_", " ") }, name);
    const kind = source.what === "σ" ? [] : [made("small", {}, `(${source.what})`)];
    const figure = made("span", { className: "figure" }, number, made("small", {}, source.unit), ...kind);
    const element = made("tr", {}, made("th", { scope: "row" }, made("div", {}, title, figure, range)),
      ...law.components.map((_, a) => cell(i, a)));
    inputs[i].row = element;
    return element;
  }

  const names = law.pairs.map((pair) => `${pair.trajectory}, ${pair.estimator}`);
  const choice = made("select", {}, ...names.map((name, k) => made("option", { value: k }, name)));
  choice.addEventListener("change", () => {
    state.pair = Number(choice.value);
    for (const [name, { least }] of Object.entries(law.pairs[state.pair].motion ?? {})) state[name] = Math.max(state[name], least);
    follow();
  });
  const reset = made("button", { type: "button" }, "Reset");
  reset.addEventListener("click", () => { Object.assign(state, stated(law), { pair: state.pair }); follow(); redraw(true); });
  const controls = made("div", { className: "controls" }, made("label", {}, "Run and estimator ", choice));
  for (const name of Object.keys(law.pairs[0].motion ?? {})) {
    const range = made("input", { type: "range", min: -1, max: 1, step: 0.01, "aria-label": `factor on the ${name}` });
    const output = made("output");
    range.addEventListener("input", () => { state[name] = 2 ** range.valueAsNumber; follow(); });
    motions.push({ name, range, output });
    controls.append(made("label", {}, `${name[0].toUpperCase()}${name.slice(1)} `, range, " ", output));
  }
  controls.append(reset);
  const head = ["source, its figure, a tenth of it to ten times", ...law.components].map((text) => made("th", { scope: "col" }, text));
  const total = made("tr", { className: "total" }, made("th", { scope: "row" }, "all together"), ...law.components.map((_, a) => cell("total", a)));
  const legend = made("p", { className: "legend" }, made("i", { className: "spread" }), " 3σ ", made("i", { className: "mean" }),
    " mean error, both in g·m²; a bar's length is relative to the largest of its kind. ",
    made("strong", {}, "!"), " the mean error exceeds 3σ.");
  const table = made("table", {}, made("thead", {}, made("tr", {}, ...head)), made("tbody", {}, total, ...law.sources.map(row)));
  place.replaceChildren(controls, made("div", { className: "scroll" }, table), legend);

  // `typed` also rewrites the number that has the focus, which is left as it is while someone types.
  function redraw(typed = false) {
    const now = evaluate(law, state);
    const rows = [["total", now.total, first.total], ...now.sources.map((parts, i) => [i, parts, first.sources[i]])];
    const most = (kind) => Math.max(...now.total.map((part) => Math.abs(part[kind])), ...now.sources.flat().map((part) => Math.abs(part[kind])), 1e-12);
    const scale = { spread: most("spread"), mean: most("mean") };
    for (const [name, parts] of rows) parts.forEach((part, a) => {
      const { spreadBar, spreadText, meanBar, meanText } = cells.get(`${name} ${a}`);
      spreadBar.style.width = `${(100 * part.spread) / scale.spread}%`;
      meanBar.style.width = `${(100 * Math.abs(part.mean)) / scale.mean}%`;
      spreadText.textContent = shown(part.spread);
      meanText.textContent = shown(part.mean) + (name === "total" && Math.abs(part.mean) > part.spread && Math.abs(part.mean) > 5e-5 ? " !" : "");
    });
    inputs.forEach(({ number, range, source, row }, i) => {
      const factor = state.factors[i];
      if (typed || document.activeElement !== number) number.value = rounded(factor * source.figure);
      range.value = Math.log10(Math.max(factor, 0.1));
      row.classList.toggle("changed", Math.abs(factor - 1) > 1e-9);
      row.title = row.classList.contains("changed") ? `stated: ${source.figure} ${source.unit}` : "";
    });
    for (const { name, range, output } of motions) {
      range.min = Math.log2(law.pairs[state.pair].motion[name].least);
      range.value = Math.log2(state[name]);
      const seconds = law.pairs[state.pair].duration;
      output.textContent = name === "duration" ? `${rounded(state.duration * seconds)} s` : `× ${rounded(state[name])}`;
    }
    choice.value = state.pair;
  }

  redraw(true);
  return (other) => { Object.assign(state, other); redraw(true); };
}

// The widget of a notebook (anywidget): the kernel hears of the state, and may set it.
export default {
  render({ model, el }) {
    const place = made("div", { className: "adjustable" });
    el.append(place);
    let own = "";
    const put = adjustable(place, model.get("law"), (state) => {
      own = JSON.stringify(state);
      model.set("state", state);
      model.save_changes();
    });
    // arrows and Enter are the controls', not JupyterLab's
    for (const control of place.querySelectorAll("input, select, button")) control.setAttribute("data-lm-suppress-shortcuts", "true");
    const take = () => {
      const state = model.get("state");
      if (Object.keys(state).length && JSON.stringify(state) !== own) put(state);
    };
    take();
    model.on("change:state", take);
  },
};
