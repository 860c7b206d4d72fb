(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  knowMethods(data.methods);
  const { universes, choices, claims } = data;
  const VERDICTS = ["supported", "contradicted", "undecided"];
  const ROW = 12;
  const part = (id) => document.getElementById(id);
  const filters = new Map(); // level by choice
  let nearAlone = false;
  let claim = claims[0];
  let picked = Math.max(0, universes.findIndex((one) => one.name === "default"));
  let layout = null; // what the curve shows: places, scales

  // A sign for each verdict: a disc, a triangle, an empty square.
  function sign(verdict, x, y, r) {
    if (verdict === "supported") return `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0z`;
    if (verdict === "contradicted") return `M${x - 1.1 * r} ${y - 0.9 * r}h${2.2 * r}l${-1.1 * r} ${1.9 * r}z`;
    return `M${x - 0.85 * r} ${y - 0.85 * r}h${1.7 * r}v${1.7 * r}h${-1.7 * r}z`;
  }

  function matches(universe) {
    if (nearAlone && !universe.near) return false;
    return [...filters].every(([choice, level]) => universe.levels[choice] === level);
  }

  // Places of the universes that have the claim's runs, by effect.
  function ordered() {
    const known = universes.map((_, i) => i).filter((i) => claim.points[i]);
    return known.sort((a, b) => claim.points[a].mean - claim.points[b].mean || a - b);
  }

  function withUnit(text) {
    return claim.unit ? `${text} ${claim.unit}` : text;
  }

  function range({ mean, low, high }) {
    return low === null ? shown(mean) : `${shown(mean)} [${shown(low)}, ${shown(high)}]`;
  }

  function words(i) {
    const point = claim.points[i];
    if (!point) return `${universes[i].name}: without the runs of ${claim.name}`;
    return `${universes[i].name}: ${withUnit(range(point))}, ${point.verdict}; ${universes[i].chosen}`;
  }

  function quantile(sorted, share) {
    const at = share * (sorted.length - 1);
    const first = Math.floor(at);
    return sorted[first] + (at - first) * ((sorted[first + 1] ?? sorted[first]) - sorted[first]);
  }

  // A few universes have intervals that would leave the others no room.
  function frame(points) {
    const means = points.map((point) => point.mean);
    const ends = points.flatMap((point) => [point.low, point.high]).filter((end) => end !== null).sort((a, b) => a - b);
    const low = Math.min(0, ...means, ...(ends.length ? [quantile(ends, 0.05)] : []));
    const high = Math.max(0, ...means, ...(ends.length ? [quantile(ends, 0.95)] : []));
    const room = 0.06 * (high - low) || 1;
    return [low - room, high + room];
  }

  function draw() {
    const plot = part("curve-plot");
    if (!claim) return;
    const width = plot.clientWidth || 340;
    const order = ordered();
    const [bottom, top] = frame(order.map((i) => claim.points[i]));
    const left = Math.round(Math.min(190, width * 0.4));
    const box = { left, right: width - 8, top: 12, bottom: 250 };
    const step = (box.right - box.left) / Math.max(order.length, 1);
    const x = (place) => box.left + (place + 0.5) * step;
    const y = (value) => box.bottom - ((Math.max(bottom, Math.min(top, value)) - bottom) / (top - bottom)) * (box.bottom - box.top);
    const rows = choices.flatMap((choice, c) => choice.levels.map((level, l) => ({ c, l, level, first: l === 0, name: choice.name })));
    const below = box.bottom + 26;
    const height = below + rows.length * ROW + 8;
    const drawing = svg("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
    layout = { order, x, step, box };

    const [from, to] = [claim.stated[0] ?? bottom, claim.stated[1] ?? top];
    drawing.append(svg("rect", { class: "stated", x: box.left, width: box.right - box.left, y: y(to), height: Math.max(0, y(from) - y(to)) }));
    for (const value of ticks(bottom, top, 5)) {
      drawing.append(
        svg("line", { class: Math.abs(value) < 1e-12 ? "zero" : "grid", x1: box.left, x2: box.right, y1: y(value), y2: y(value) }),
        svg("text", { x: box.left - 6, y: y(value) + 4, "text-anchor": "end" }, String(+value.toPrecision(6))),
      );
    }
    const place = order.indexOf(picked);
    if (place >= 0) {
      const wide = Math.max(step, 5);
      drawing.append(svg("rect", { class: "picked", x: x(place) - wide / 2, width: wide, y: box.top - 8, height: height - box.top }));
    }
    const size = Math.max(1.6, Math.min(3.6, step * 0.42));
    for (const faded of [true, false]) {
      for (const verdict of VERDICTS) {
        let whiskers = "";
        let signs = "";
        let dots = "";
        order.forEach((i, k) => {
          const point = claim.points[i];
          if (point.verdict !== verdict || matches(universes[i]) === faded) return;
          if (point.low !== null) whiskers += `M${x(k).toFixed(1)} ${y(point.low).toFixed(1)}V${y(point.high).toFixed(1)}`;
          signs += sign(verdict, +x(k).toFixed(1), +y(point.mean).toFixed(1), size);
          let row = 0;
          choices.forEach((choice, c) => {
            const at = below + (row + universes[i].levels[c]) * ROW + ROW / 2;
            dots += sign(verdict, +x(k).toFixed(1), at, Math.min(2.6, size));
            row += choice.levels.length;
          });
        });
        const group = svg("g", { class: `${verdict}${faded ? " faded" : ""}` });
        group.append(
          svg("path", { class: `whisker ${verdict}`, d: whiskers }),
          svg("path", { class: `sign effects ${verdict}`, d: signs }),
          svg("path", { class: `sign choices ${verdict}`, d: dots }),
        );
        drawing.append(group);
      }
    }
    order.forEach((i, k) => {
      if (universes[i].name === "default") drawing.append(svg("circle", { class: "default", cx: x(k), cy: y(claim.points[i].mean), r: size + 3 }));
      if (universes[i].near) drawing.append(svg("line", { class: "near", x1: x(k), x2: x(k), y1: box.bottom + 4, y2: box.bottom + 11 }));
    });
    rows.forEach((row, k) => {
      const at = below + k * ROW;
      if (row.first) {
        drawing.append(
          svg("line", { class: "rule", x1: 0, x2: box.right, y1: at, y2: at }),
          svg("text", { class: "level choice", x: 2, y: at + ROW - 2.5 }, short(row.name, left - 66)),
        );
      }
      drawing.append(svg("text", { class: "level", x: box.left - 5, y: at + ROW - 2.5, "text-anchor": "end" }, row.level));
    });
    const tip = element("div", { class: "tip", "aria-hidden": "true", hidden: "" });
    plot.replaceChildren(drawing, tip);
    tell();
  }

  // Names that would run into their levels are cut.
  function short(text, room) {
    const most = Math.max(4, Math.floor(room / 5.6));
    return text.length > most ? `${text.slice(0, most - 1)}…` : text;
  }

  // What a screen reader is told, and who matches.
  function tell() {
    const plot = part("curve-plot");
    const order = layout.order;
    const place = order.indexOf(picked);
    plot.setAttribute("aria-valuemin", 1);
    plot.setAttribute("aria-valuemax", Math.max(1, order.length));
    plot.setAttribute("aria-valuenow", Math.max(1, place + 1));
    plot.setAttribute("aria-valuetext", words(picked));
    const there = order.filter((i) => matches(universes[i]));
    const counts = VERDICTS.map((verdict) => `${there.filter((i) => claim.points[i].verdict === verdict).length} ${verdict}`);
    part("matching").textContent = `${there.length} of ${order.length} universes${there.length < order.length ? " match" : ""}: ${counts.join(", ")}.`;
    part("curve-caption").textContent = `${claim.name} ${claim.text}: ${withUnit(claim.what + (claim.unit ? "," : ""))}`;
  }

  function tip(i) {
    const box = part("curve-plot").querySelector(".tip");
    if (i === null) {
      box.hidden = true;
      return;
    }
    const point = claim.points[i];
    box.replaceChildren(element("strong", {}, universes[i].name), element("br"), withUnit(range(point)), element("br"), point.verdict);
    box.hidden = false;
    const at = layout.x(layout.order.indexOf(i));
    const plot = part("curve-plot").clientWidth;
    const beside = at > plot / 2 ? at - box.offsetWidth - 12 : at + 12;
    box.style.left = `${Math.max(0, Math.min(plot - box.offsetWidth, beside))}px`;
  }

  // The matching universe nearest to a pointer.
  function under(event) {
    const at = event.clientX - part("curve-plot").getBoundingClientRect().left;
    if (at < layout.box.left - 4) return null;
    let best = null;
    layout.order.forEach((i, k) => {
      if (!matches(universes[i])) return;
      const far = Math.abs(layout.x(k) - at);
      if (best === null || far < best.far) best = { i, far };
    });
    return best && best.i;
  }

  function keyed(event) {
    const there = layout.order.filter((i) => matches(universes[i]));
    if (!there.length) return;
    const last = there.length - 1;
    let from = there.indexOf(picked);
    if (from < 0) from = event.key === "ArrowLeft" ? 1 : -1;
    const targets = { ArrowLeft: from - 1, ArrowDown: from - 1, ArrowRight: from + 1, ArrowUp: from + 1, PageDown: from - 10, PageUp: from + 10, Home: 0, End: last };
    if (!(event.key in targets)) return;
    pick(there[Math.max(0, Math.min(last, targets[event.key]))]);
    event.preventDefault();
  }

  // The universe that is looked at.

  const fig5 = new Group(data.axis, { unit: `RMSE (${data.unit})` });
  const charts = [];

  function pick(i) {
    picked = i;
    const one = universes[i];
    part("universe-chosen").textContent = `${one.name}: ${one.chosen}${one.near ? "; among the nearest to the authors' clip" : ""}.`;
    part("universe-commands").textContent = one.commands.join("\n");
    charts.forEach((chart, k) => {
      chart.lines = one.panels[k].lines;
      chart.figure.hidden = !chart.lines.length;
    });
    fig5.draw();
    const table = part("universe-claims");
    for (const body of [...table.tBodies]) body.remove();
    for (const found of one.claims) {
      const body = element("tbody", {}, element("tr", { class: "claim" },
        element("th", { scope: "rowgroup", colspan: 3 }, `${found.name} ${found.text}`), element("td", {}, chip(found.verdict))));
      for (const [what, effect, stated, verdict] of found.compared) {
        body.append(element("tr", {}, element("td", {}, what), element("td", { class: "number" }, effect),
          element("td", { class: "number" }, stated), element("td", { class: verdict }, verdict)));
      }
      table.append(body);
    }
    draw();
    list();
  }

  function chip(verdict) {
    return element("span", { class: `chip ${verdict}` }, verdict);
  }

  // The universes that match, by effect; the one that is looked at is among them in any case.
  function list() {
    const select = part("universe-choice");
    const order = layout ? layout.order : [];
    const there = order.filter((i) => matches(universes[i]) || i === picked);
    if (!there.includes(picked)) there.push(picked);
    select.replaceChildren(...there.map((i) => {
      const point = claim && claim.points[i];
      const told = point ? `: ${withUnit(shown(point.mean))}, ${point.verdict}` : "";
      return element("option", { value: i }, `${universes[i].name}${told}`);
    }));
    select.value = picked;
  }

  // What moves the claim that is looked at.

  function moves() {
    part("moves-claim").textContent = `${claim.name} ${claim.text}: ${claim.what}`;
    const named = (rows) => new Map(rows.map((row) => [`${row.choice}\n${row.level}`, row]));
    const [alone, jointly] = [named(claim.alone), named(claim.jointly)];
    const rows = [];
    for (const { name, levels } of choices) {
      for (const level of levels) {
        const id = `${name}\n${level}`;
        const [one, other] = [alone.get(id), jointly.get(id)];
        if (one || other) rows.push(levelRow(name, level, one, other));
      }
    }
    for (const row of claim.rules) rows.push(levelRow(row.choice, row.level, row.verdict ? row : undefined));
    part("levels").tBodies[0].replaceChildren(...rows);
    const test = claim.test;
    part("joint-test").textContent = test.flips
      ? `Over all universes at once, by ${test.flips} sign flips of the seeds: median effect ${withUnit(shown(test.median))}, p ${shown(test.p_median)}; ` +
        `mean t ${shown(test.mean_t)}, p ${shown(test.p_mean_t)}; ${Math.round(100 * test.one_side)} % of the universes on one side of zero.`
      : "Of a single seed there is no test over all universes.";
    part("rules").replaceChildren(...claim.rules.map((row) => element("li", {},
      `${row.choice} ${row.level}: supported in ${row.supported}, contradicted in ${row.contradicted}, undecided in ${row.undecided} universes`)));
    part("pairs").replaceChildren(...claim.pairs.map((row) => element("li", {},
      `${row.first} x ${row.second}: ${percent(row.share)} more than both alone, p ${shown(row.p)}; ${row.levels}: ${range(row)}`)));
  }

  function percent(share) {
    return share === null || share === undefined ? "–" : `${Math.round(100 * share)} %`;
  }

  function levelRow(choice, level, alone, jointly) {
    const number = (text) => element("td", { class: "number" }, text);
    return element("tr", {}, element("th", { scope: "row" }, choice), element("td", {}, level),
      number(alone ? range(alone) : ""), element("td", { class: alone ? alone.verdict : "" }, alone ? alone.verdict : ""),
      number(jointly ? range(jointly) : ""), number(jointly ? percent(jointly.share) : ""), number(jointly ? shown(jointly.p) : ""));
  }

  // The choices of the reader.

  function setUp() {
    const host = part("filter-choices");
    const filter = (title, names, choose) => {
      const select = element("select", {}, element("option", { value: "" }, "any"), ...names.map((name, i) => element("option", { value: i }, name)));
      select.addEventListener("change", () => {
        choose(select.value === "" ? null : Number(select.value));
        draw();
        list();
      });
      host.append(element("label", {}, title, select));
    };
    choices.forEach((choice, c) => filter(choice.name, choice.levels, (level) => (level === null ? filters.delete(c) : filters.set(c, level))));
    const near = universes.some((one) => one.near);
    if (near) filter("the authors' clip", ["nearest"], (level) => (nearAlone = level !== null));
    part("no-filter").addEventListener("click", () => {
      filters.clear();
      nearAlone = false;
      for (const select of host.querySelectorAll("select")) select.value = "";
      draw();
      list();
    });
    const keys = VERDICTS.map((verdict) => [svg("path", { class: `sign ${verdict}`, d: sign(verdict, 7, 7, 4) }), verdict]);
    keys.push([svg("circle", { class: "default", cx: 7, cy: 7, r: 5.5 }), "the defaults"]);
    if (near) keys.push([svg("line", { class: "near", x1: 7, x2: 7, y1: 2, y2: 12 }), "nearest to the clip"]);
    for (const [mark, name] of keys) {
      part("signs").append(element("li", {}, svg("svg", { viewBox: "0 0 14 14", "aria-hidden": "true", class: VERDICTS.includes(name) ? name : "" }, mark), name));
    }
    for (const panel of universes[picked].panels) {
      const chart = new Chart(fig5, panel.title, []);
      charts.push(chart);
      part("curve-panels").append(chart.figure);
    }
    const lines = universes.flatMap((one) => one.panels.flatMap((panel) => panel.lines));
    legend(document.querySelector("[data-legend=curves]"), methodsOf(lines));
    part("universe-choice").addEventListener("change", (event) => pick(Number(event.target.value)));
    const plot = part("curve-plot");
    plot.addEventListener("keydown", keyed);
    plot.addEventListener("pointermove", (event) => tip(under(event)));
    plot.addEventListener("pointerleave", () => tip(null));
    plot.addEventListener("click", (event) => {
      const i = under(event);
      if (i !== null) pick(i);
    });
    let width = 0;
    new ResizeObserver(() => {
      if (Math.abs(plot.clientWidth - width) > 1) draw();
      width = plot.clientWidth;
    }).observe(plot);
  }

  theme();
  if (claims.length) {
    setUp();
    options(part("claim-choice"), claims.map((one) => `${one.name}: ${one.text}`), 0, (i) => {
      claim = claims[i];
      draw();
      list();
      moves();
    });
    pick(picked);
  }
  printing();
})();
