"use strict";
// The page is complete without this script. It adds: values under the pointer, actors on and off, single seeds,
// tables that sort and filter, and folded parts opened for the printer.
(() => {
  const SVG = "http://www.w3.org/2000/svg";
  const make = (tag, attributes = {}, parent = null, text = "") => {
    const node = tag.startsWith("svg:") ? document.createElementNS(SVG, tag.slice(4)) : document.createElement(tag);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (text) node.textContent = text;
    if (parent) parent.append(node);
    return node;
  };
  const shown = value => value === null ? "–" : (Math.abs(value) < 10 ? value.toFixed(1) : Math.round(value).toLocaleString("en")).replace("-", "−");
  const ink = colour => colour === "#000000" ? "currentColor" : colour;

  // ---- learning curves -------------------------------------------------------------------------------------------
  const [W, H, LEFT, RIGHT, TOP, BOTTOM] = [400, 250, 50, 12, 22, 34];
  const ticks = (low, high, count) => {
    const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
    const step = [1, 2, 5, 10].map(m => m * power).find(s => s >= raw);
    const found = [];
    for (let v = Math.ceil(low / step) * step; v <= high + step * 1e-9; v += step) found.push(Math.abs(v) < step * 1e-9 ? 0 : v);
    return found;
  };
  const line = (steps, values, x, y) => {
    let path = "", pen = false;
    steps.forEach((step, i) => {
      if (values[i] === null) { pen = false; return; }
      path += `${pen ? "L" : "M"}${x(step).toFixed(1)} ${y(values[i]).toFixed(1)}`;
      pen = true;
    });
    return path;
  };
  const panel = (task, state, parent) => {
    const box = make("div", { class: "panel" }, parent);
    const svg = make("svg:svg", { viewBox: `0 0 ${W} ${H}`, role: "img", tabindex: 0, "aria-label": `${task.label}: average return by environment step; arrow keys read values` }, box);
    const output = make("output", {}, box);
    let at = null;
    const draw = () => {
      svg.replaceChildren();
      const arms = task.arms.filter(arm => state.on.has(arm.arm));
      const every = arms.flatMap(arm => [arm.smooth, arm.low, arm.high, ...(state.seeds ? arm.seeds.map(s => s[1]) : [])]).flat().filter(v => v !== null);
      const low = Math.min(0, ...every), high = Math.max(1, ...every);
      const x = step => LEFT + (W - LEFT - RIGHT) * step / task.horizon;
      const y = value => H - BOTTOM - (H - TOP - BOTTOM) * (value - low) / (high - low);
      make("svg:text", { x: LEFT, y: 14, class: "title" }, svg, task.label);
      for (const v of ticks(low, high, 5)) {
        make("svg:line", { x1: LEFT, x2: W - RIGHT, y1: y(v), y2: y(v), class: "grid" }, svg);
        make("svg:text", { x: LEFT - 5, y: y(v) + 4, "text-anchor": "end" }, svg, shown(v).replace(".0", ""));
      }
      const unit = task.horizon >= 500000 ? [1e6, "million"] : [1e3, "thousand"];
      for (const v of ticks(0, task.horizon, 5)) make("svg:text", { x: x(v), y: H - BOTTOM + 14, "text-anchor": "middle" }, svg, String(+(v / unit[0]).toPrecision(6)));
      make("svg:text", { x: (LEFT + W - RIGHT) / 2, y: H - 4, "text-anchor": "middle" }, svg, `Environment steps (${unit[1]})`);
      for (const arm of arms) {
        const colour = ink(arm.color), band = arm.steps.map((s, i) => [s, arm.low[i], arm.high[i]]).filter(r => r[1] !== null);
        if (band.length) {
          const d = band.map(r => `${x(r[0]).toFixed(1)} ${y(r[2]).toFixed(1)}`).concat(band.slice().reverse().map(r => `${x(r[0]).toFixed(1)} ${y(r[1]).toFixed(1)}`));
          make("svg:path", { d: `M${d.join("L")}Z`, class: "fill" }, svg).style.fill = colour;
        }
        const strokes = state.seeds ? arm.seeds.map(s => [s[0], s[1], "faint seed"]) : [[arm.steps, arm.mean, "faint raw"]];
        for (const [steps, values, kind] of [...strokes, [arm.steps, arm.smooth, "mean"]])
          make("svg:path", { d: line(steps, values, x, y), class: kind, stroke: colour, "stroke-dasharray": kind === "mean" ? arm.dash : "none", "data-arm": arm.arm }, svg);
      }
      if (at !== null) {
        make("svg:line", { x1: x(at), x2: x(at), y1: TOP, y2: H - BOTTOM, class: "hair" }, svg);
        const words = arms.map(arm => [arm, arm.steps.indexOf(at)]).filter(([, i]) => i >= 0).map(([arm, i]) => `${arm.name} ${shown(arm.mean[i])}`);
        output.textContent = `Step ${at.toLocaleString("en")}: ${words.join(" · ")}`;
      }
    };
    const steps = [...new Set(task.arms.flatMap(arm => arm.steps))].sort((a, b) => a - b);
    const read = step => { at = step; draw(); };
    svg.addEventListener("pointermove", event => {
      const frame = svg.getBoundingClientRect();
      const step = ((event.clientX - frame.left) * W / frame.width - LEFT) / (W - LEFT - RIGHT) * task.horizon;
      read(steps.reduce((best, s) => Math.abs(s - step) < Math.abs(best - step) ? s : best, steps[0]));
    });
    svg.addEventListener("pointerleave", () => { at = null; output.textContent = ""; draw(); });
    svg.addEventListener("keydown", event => {
      const move = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!move) return;
      event.preventDefault();
      const index = at === null ? (move > 0 ? -1 : steps.length) : steps.indexOf(at);
      read(steps[Math.max(0, Math.min(steps.length - 1, index + move))]);
    });
    state.redraw.push(draw);
  };
  for (const figure of document.querySelectorAll("figure[data-curves]")) {
    const data = JSON.parse(document.getElementById(figure.dataset.curves).textContent);
    const state = { on: new Set(data.first), seeds: false, redraw: [] };
    const live = figure.querySelector(".live"), controls = make("div", { class: "controls only-script", role: "group", "aria-label": "Actors and seeds shown" }, live);
    const refresh = () => state.redraw.forEach(draw => draw());
    for (const arm of data.arms) {
      const button = make("button", { type: "button", "aria-pressed": state.on.has(arm.arm), "data-arm": arm.arm }, controls);
      const key = make("svg:svg", { viewBox: "0 0 32 10", "aria-hidden": true }, button);
      make("svg:line", { x1: 0, x2: 32, y1: 5, y2: 5, stroke: ink(arm.color), "stroke-width": 2.5, "stroke-dasharray": arm.dash }, key);
      button.append(arm.name);
      button.addEventListener("click", () => {
        if (!state.on.delete(arm.arm)) state.on.add(arm.arm);
        button.setAttribute("aria-pressed", state.on.has(arm.arm));
        refresh();
      });
    }
    const label = make("label", {}, controls), box = make("input", { type: "checkbox" }, label);
    label.append(" single seeds");
    box.addEventListener("change", () => { state.seeds = box.checked; refresh(); });
    const panels = make("div", { class: "panels only-script" }, live);
    panels.style.setProperty("--count", data.tasks.length);
    for (const task of data.tasks) panel(task, state, panels);
    refresh();
  }

  // ---- tables ----------------------------------------------------------------------------------------------------
  const sortable = text => {
    const cleaned = text.replace(/−/g, "-").replace(/,(?=\d{3})/g, "").replace(/^[<>≈]\s*/, "");
    const value = parseFloat(cleaned);
    return Number.isNaN(value) ? null : value;
  };
  for (const table of document.querySelectorAll("table.data")) {
    const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, column) => {
      const button = make("button", { type: "button" }, null, head.textContent);
      head.replaceChildren(button);
      button.addEventListener("click", () => {
        const up = head.getAttribute("aria-sort") !== "ascending";
        heads.forEach(other => other.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", up ? "ascending" : "descending");
        const keyed = [...body.rows].map(row => [row, row.cells[column].textContent.trim()]);
        const numeric = head.classList.contains("number");
        keyed.sort(([, a], [, b]) => {
          const [m, n] = numeric ? [sortable(a), sortable(b)] : [a, b];
          if (m === null || n === null) return (m === null) - (n === null);
          return (numeric ? m - n : m.localeCompare(n, "en")) * (up ? 1 : -1);
        });
        body.append(...keyed.map(([row]) => row));
      });
    });
    if (body.rows.length < 8) continue;
    const input = make("input", { type: "search", class: "filter", placeholder: "filter rows", "aria-label": `Filter the rows of ${table.dataset.title}` });
    table.closest(".scroll").before(input);
    input.addEventListener("input", () => {
      const words = input.value.toLowerCase().split(/\s+/);
      for (const row of body.rows) row.hidden = !words.every(word => row.textContent.toLowerCase().includes(word));
    });
  }

  // ---- the printer -----------------------------------------------------------------------------------------------
  let folded = [];
  addEventListener("beforeprint", () => {
    folded = [...document.querySelectorAll("details:not([open])")];
    folded.forEach(part => { part.open = true; });
  });
  addEventListener("afterprint", () => folded.forEach(part => { part.open = false; }));
  for (const link of document.querySelectorAll('a[href^="#"]')) link.addEventListener("click", () => {
    for (let node = document.querySelector(link.getAttribute("href")); node; node = node.parentElement) if (node.tagName === "DETAILS") node.open = true;
  });
  document.documentElement.classList.add("js");
})();
