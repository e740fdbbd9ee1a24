"use strict";
// Computes with the table that runs/handbook/live/table.py makes; the formulas are those of LiveTable there.
const liveModel = (() => {
  const scales = {linear: (x) => x, log: Math.log, sqrt: Math.sqrt};

  function weights(axis, value) {
    const into = scales[axis.scale], low = into(axis.low), high = into(axis.high), n = axis.count;
    const x = (2 * into(value) - high - low) / (high - low);
    const terms = [];
    for (let j = 0; j < n; j++) {
      const angle = (j + 0.5) * Math.PI / n, away = x - Math.cos(angle);
      if (away === 0) return Array.from({length: n}, (_, k) => (k === j ? 1 : 0));
      terms.push((j % 2 ? -1 : 1) * Math.sin(angle) / away);
    }
    const sum = terms.reduce((a, b) => a + b, 0);
    return terms.map((t) => t / sum);
  }

  function blend(w, values) {
    if (typeof values[0] === "number") return values.reduce((sum, v, k) => sum + w[k] * v, 0);
    return values[0].map((_, i) => blend(w, values.map((v) => v[i])));
  }

  const interpolate = (axes, values, at) => axes.reduce((v, axis, k) => blend(weights(axis, at[k]), v), values);
  const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

  return (table) => {
    const {poisson: NU, distance: L, depth: DEPTH, around: AROUND, reach: REACH, fine_poisson: FINE} = table.axes;
    const deepest = (h) => Math.min(table.deepest[0], table.deepest[1] * h);
    const part = (h) => (h > table.thickness[0].high ? 1 : 0);
    const reference = (nu, l, q) => q * q * (1 - nu * nu) / (Math.PI * l * l);

    function pair(nu, h, l, d) {
      const axes = [NU, table.thickness[part(h)], DEPTH, L], at = [nu, h, d / deepest(h), l], p = table.patches[part(h)];
      const hertz = 4 / 3 * d ** 1.5 / (1 - nu * nu);
      const normal = hertz * Math.exp(interpolate(axes, p.normal, at));
      const points = interpolate([FINE, REACH], table.point_ratio, [nu, clamp(l / h, REACH.low, REACH.high)]);
      const unit = reference(nu, l, normal);
      const [ofT, ofQ] = table.error_of_kind[8 * part(h) + 4 * (nu > 0.44) + 2 * (l < 2.2) + (d > 0.5 * deepest(h))];
      const tangential = (interpolate(axes, p.remainder, at) + points) * unit;
      return {normal, tangential, error: ofT * unit, normalError: ofQ * normal};
    }

    function alone(nu, h, d) {
      const axes = [NU, table.thickness[part(h)], DEPTH], p = table.patches[part(h)];
      const at = [nu, h, clamp(d / deepest(h), DEPTH.low, DEPTH.high)];
      const radius = interpolate(axes, p.radius, at), around = interpolate(axes, p.around, at);
      return (r) => {
        if (r <= radius) return d - 1 + Math.sqrt(1 - r * r);
        return d * blend(weights(AROUND, Math.min(r - radius, AROUND.high)), around);
      };
    }

    function section(nu, h, l, d) {
      let depth = d;
      for (let k = 0; k < 30; k++) depth = d - alone(nu, h, depth)(l);
      const dent = alone(nu, h, depth);
      return (x) => {
        let w = dent(Math.abs(x + l / 2)) + dent(Math.abs(x - l / 2));
        for (const side of [-1, 1]) {
          const r = Math.abs(x - side * l / 2);
          if (r < 1) w = Math.max(w, d - 1 + Math.sqrt(1 - r * r));
        }
        return w;
      };
    }

    // Sliding path over R and friction until the balls touch, until L has grown by R, or the distance where T = 0.
    function drift(nu, h, l, d) {
      const rate = (at) => { const f = pair(nu, h, at, d); return f.tangential / f.normal; };
      const first = rate(l), steps = 60;
      const end = first > 0 ? L.low : Math.min(l + 1, L.high);
      if (end === l) return {end, path: 0};
      let path = 0, before = first;
      for (let k = 1; k <= steps; k++) {
        const here = l + (end - l) * k / steps, now = rate(here);
        if (now * first <= 0) return {rest: here - (end - l) / steps * now / (now - before)};
        path += Math.abs(end - l) / steps * 0.25 * (1 / Math.abs(before) + 1 / Math.abs(now));
        before = now;
      }
      return {end, path};
    }

    // S_Q at the same normal force, where finite strain was computed: between load steps along a straight line.
    function strengthening(nu, h, l, d) {
      for (const c of table.strengthening) {
        const near = Math.abs(h / c.thickness - 1) < 0.005 && Math.abs(l / c.distance - 1) < 0.005;
        if (!near || Math.abs(nu - c.poisson) > 0.0006) continue;
        const p = c.points, k = p.findIndex((point) => point[0] >= d * (1 - 1e-9));
        if (k < 0 || d < p[0][0] * (1 - 1e-9)) return null;
        if (k === 0) return {factor: p[0][1], error: p[0][2]};
        const [a, b] = [p[k - 1], p[k]], t = (d - a[0]) / (b[0] - a[0]);
        const others = [p[k - 2], p[k + 1]].filter((point) => point !== undefined);
        const slope = (u, v) => (v[1] - u[1]) / (v[0] - u[0]);
        const bends = others.map((o) => Math.abs((slope(a, b) - (o[0] < a[0] ? slope(o, a) : slope(b, o)))
          / (o[0] < a[0] ? b[0] - o[0] : o[0] - a[0])));
        const curvature = Math.max(0, ...bends) * (d - a[0]) * (b[0] - d);
        const factor = a[1] + t * (b[1] - a[1]), error = a[2] + t * (b[2] - a[2]) + curvature;
        return error <= 0.1 * Math.abs(factor) ? {factor, error} : null;  // a sign change of T lies near
      }
      return null;
    }

    // S_Q by the fit of `thirdbody plan` (runs/comparison/strengthening_fit.py), in its range.
    function fitted(nu, h, l, d) {
      const fit = table.fit, inside = (x, [low, high]) => x >= low * (1 - 1e-9) && x <= high * (1 + 1e-9);
      const curve = fit.curves.find((c) => inside(h, c.range));
      if (!curve || !inside(l, fit.distances) || !inside(nu, fit.poissons) || !inside(d, [0, fit.approach])) return null;
      let change = curve.coefficients.reduce((sum, c, k) => sum + c * d ** (k + 1), 0);
      let error = fit.error + fit.growth * d * d;
      if (curve.varies) {
        const away = [h - curve.thickness, nu - fit.poisson, l - fit.distances[0]];
        change *= Math.exp(away.reduce((sum, x, k) => sum + x * fit.slopes[k], 0));
        error += Math.abs(change) * away.reduce((sum, x, k) => sum + Math.abs(x) * fit.unsure[k], 0);
      }
      return {factor: 1 + change, error};
    }

    return {pair, section, drift, strengthening, fitted, deepest, L, thickness: table.thickness};
  };
})();

(() => {
  const root = document.getElementById("live"), table = JSON.parse(document.getElementById("live-table").textContent);
  const model = liveModel(table), input = {}, shown = {};
  root.querySelectorAll("input[type=range]").forEach((slider) => { input[slider.name] = slider; });
  root.querySelectorAll("[data-shows]").forEach((place) => { shown[place.dataset.shows] = place; });

  const digits = (x, n = 3) => (x === 0 ? "0" : Number(x.toPrecision(n)).toLocaleString("en", {maximumSignificantDigits: n,
    useGrouping: false}));
  const withError = (x, error) => {  // the value to the one digit of its error
    const bar = Number(error.toPrecision(1)), places = Math.max(0, -Math.floor(Math.log10(bar) + 1e-9));
    return `${x.toFixed(places)} ± ${bar.toFixed(places)}`.replace(/^-(?=0(\.0*)? )/, "").replace("-", "−");
  };
  function withUnit(x, unit, error) {
    const size = Math.max(Math.abs(x), error ?? 0);
    const [factor, prefix] = size >= 1 || size === 0 ? [1, ""] : size >= 1e-3 ? [1e3, "m"] : size >= 1e-6 ? [1e6, "µ"]
      : size >= 1e-9 ? [1e9, "n"] : [1e12, "p"];
    return `${error === undefined ? digits(x * factor) : withError(x * factor, error * factor)} ${prefix}${unit}`;
  }

  const limited = new Set();  // inputs that are not where the user wants them, as the table ends there
  function limit(name, low, high) {
    const slider = input[name], value = Math.min(Math.max(Number(slider.value), low), high);
    if (value !== Number(slider.value)) limited.add(name);
    slider.min = low; slider.max = high; slider.value = value;
    return Number(slider.value);
  }

  function update() {
    const R = Number(input.radius.value), E = Number(input.young.value), nu = Number(input.poisson.value);
    const f = Number(input.friction.value);
    const h = limit("thickness", table.thickness[0].low * R, table.thickness[1].high * R);
    const L = limit("distance", model.L.low * R, model.L.high * R);
    const D = limit("approach", table.axes.depth.low * model.deepest(h / R) * R, model.deepest(h / R) * R);
    const at = [nu, h / R, L / R, D / R], force = E * R * R;  // MPa mm² = N
    const found = model.pair(...at), T = found.tangential * force, error = found.error * force;
    const Q = found.normal * force, resolved = Math.abs(T) > error;
    for (const [name, slider] of Object.entries(input)) shown[`${name}-value`].value = digits(Number(slider.value), 4);
    shown.normal.textContent = withUnit(Q, "N", found.normalError * force);
    shown.tangential.textContent = withUnit(T, "N", error);
    shown.kind.textContent = resolved ? (T > 0 ? "attraction" : "separation") : "neither: T is below its error";
    shown.kind.dataset.kind = resolved ? (T > 0 ? "attraction" : "separation") : "neither";
    const share = found.tangential / found.normal, power = Math.floor(Math.log10(Math.abs(share)));
    const written = power < -3 ? `${digits(share / 10 ** power)}e${power}` : digits(share);
    shown.share.textContent = resolved ? written.replaceAll("-", "−") : "not resolved";
    const computed = model.strengthening(...at), S = computed ?? model.fitted(...at);
    const by = computed ? "" : ", by a fit";
    shown.strengthening.textContent = S ? `${withError(S.factor, S.error)}${by}` : "not known here";
    shown.drift.textContent = resolved ? driftText(model.drift(...at), T > 0, R, f) : "no motion that the table resolves";
    draw(at, T, resolved);
    const symbol = (name) => input[name].parentElement.firstChild.textContent.trim().split(",")[0];
    const ends = [...limited].map((name) => `${symbol(name)} = ${digits(Number(input[name].value), 4)}`);
    shown.limited.textContent = ends.length ? `The table has no other value here: ${ends.join(", ")}.` : "";
    limited.clear();
    root.dataset.values = JSON.stringify({at, Q, T, error, normalError: found.normalError * force, S,
      drift: model.drift(...at)});
  }

  function driftText(drift, attract, R, f) {
    if (drift.rest !== undefined) return `they come to rest at L = ${digits(drift.rest * R)} mm, where T = 0`;
    if (drift.path === 0) return attract ? "they touch" : "the table ends at this distance";
    const path = withUnit(drift.path * R * f * 1e-3, "m");
    return attract ? `they touch after ${path} of sliding` : `at L = ${digits(drift.end * R)} mm after ${path} of sliding`;
  }

  function draw([nu, h, L, D], T, resolved) {
    const width = 640, height = 300, half = L / 2 + 2.2, scale = width / (2 * half), top = 2.15 - D;
    const X = (x) => (x + half) * scale, Y = (z) => (top - z) * scale;
    const w = model.section(nu, h, L, D), tall = Math.min(height, Y(-h) + 14), points = [];
    for (let k = 0; k <= 320; k++) { const x = -half + 2 * half * k / 320; points.push(`${X(x).toFixed(1)},${Y(-w(x)).toFixed(1)}`); }
    const floor = Math.min(Y(-h), height), ball = (x) => `<circle class="ball" cx="${X(x)}" cy="${Y(1 - D)}" r="${scale}"/>`;
    const reach = 0.75 * scale, arrow = (side) => {
      const x = X(side * L / 2), sign = resolved ? -side * Math.sign(T) : 0;
      return sign ? `<path class="arrow" d="M${x} ${Y(1 - D)} h${sign * reach} m${-sign * 9} -5 l${sign * 9} 5 l${-sign * 9} 5"/>` : "";
    };
    shown.section.setAttribute("viewBox", `0 0 ${width} ${tall.toFixed(1)}`);
    shown.section.innerHTML = `<polygon class="layer" points="0,${floor} ${points.join(" ")} ${width},${floor}"/>`
      + (floor < height ? `<rect class="base" x="0" y="${floor}" width="${width}" height="14"/>` : "")
      + `<line class="level" x1="0" x2="${width}" y1="${Y(0)}" y2="${Y(0)}"/>` + ball(-L / 2) + ball(L / 2)
      + `<polyline class="surface" points="${points.join(" ")}"/>` + arrow(-1) + arrow(1);
  }

  function set(values) {
    for (const name of ["radius", "young", "poisson", "friction", "thickness", "distance", "approach"]) {
      if (values[name] === undefined) continue;
      if (["thickness", "distance", "approach"].includes(name)) { input[name].min = 0; input[name].max = 1e6; }
      input[name].value = values[name];
      if (Number(input[name].value) !== values[name]) limited.add(name);
    }
    update();
  }

  table.strengthening.forEach((c, k) => {
    const option = document.createElement("option");
    option.value = k;
    option.textContent = `h = ${c.thickness} R, L = ${c.distance} R, nu = ${c.poisson}`;
    shown.cases.append(option);
  });
  shown.cases.addEventListener("change", () => {
    const c = table.strengthening[Number(shown.cases.value)], R = Number(input.radius.value);
    if (c) set({poisson: c.poisson, thickness: c.thickness * R, distance: c.distance * R, approach: c.points.at(-2)[0] * R});
  });
  Object.values(input).forEach((slider) => {
    const field = shown[`${slider.name}-value`];
    slider.addEventListener("input", update);
    slider.setAttribute("aria-label", slider.parentElement.firstChild.textContent.trim());
    field.addEventListener("change", () => set({[slider.name]: Number(field.value)}));
  });
  root.addEventListener("set-values", (event) => set(event.detail));
  update();
})();
