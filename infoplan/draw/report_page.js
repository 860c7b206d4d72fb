(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const methods = new Map(data.methods.map((method) => [method.name, method]));
  const hidden = new Set(data.methods.filter((method) => !method.shown).map((method) => method.name));
  const groups = [];
  let singleSeeds = false;

  // Path along points; a missing value interrupts it.
  function path(points) {
    let text = "";
    let pen = "M";
    for (const point of points) {
      if (point === null) pen = "M";
      else {
        text += `${pen}${point[0].toFixed(1)} ${point[1].toFixed(1)}`;
        pen = "L";
      }
    }
    return text;
  }

  // What runs along the horizontal axis: its label, and how a value of it is said.

  const SAMPLES = { label: "collected samples", one: "a number of collected samples", say: (value) => `${value} samples` };
  const LEVELS = {
    label: "level of the interval",
    one: "a level",
    say: (value) => `interval of ${+(100 * value).toPrecision(3)} %`,
    diagonal: true,
  };

  // A chart: lines over such an axis. The charts of a group share scale and cursor.

  class Group {
    constructor(axis, { unit, top, across = SAMPLES }) {
      Object.assign(this, { axis, unit, top, across, charts: [], cursor: null });
      groups.push(this);
    }

    draw() {
      for (const chart of this.charts) chart.draw();
    }

    highest() {
      if (this.top) return this.top;
      let most = 0;
      for (const chart of this.charts) {
        for (const line of chart.visible()) {
          const seeds = singleSeeds ? Object.values(line.seeds ?? {}) : [];
          for (const values of [line.mean, line.high, ...seeds]) most = Math.max(most, ...values);
        }
      }
      return most * 1.04 || 1;
    }

    move(cursor, active) {
      this.cursor = cursor;
      for (const chart of this.charts) chart.point(chart === active);
    }
  }

  class Chart {
    constructor(group, title, lines) {
      this.group = group;
      this.title = title;
      this.lines = lines;
      this.tip = element("div", { class: "tip", "aria-hidden": "true", hidden: "" });
      this.plot = element("div", {
        class: "plot",
        tabindex: "0",
        role: "slider",
        "aria-label": `${title}: values at ${group.across.one}`,
        "aria-valuemin": group.axis[0],
        "aria-valuemax": group.axis.at(-1),
      });
      this.figure = element("figure", {}, element("figcaption", {}, title), this.plot);
      this.plot.addEventListener("pointermove", (event) => this.follow(event));
      this.plot.addEventListener("pointerdown", (event) => this.follow(event));
      this.plot.addEventListener("pointerleave", () => group.move(null));
      this.plot.addEventListener("focus", () => {
        if (group.cursor === null) group.move(group.axis.length - 1, this);
      });
      this.plot.addEventListener("blur", () => group.move(null));
      this.plot.addEventListener("keydown", (event) => this.key(event));
      new ResizeObserver(() => {
        if (Math.abs(this.plot.clientWidth - this.width) > 1) this.draw();
      }).observe(this.plot);
      group.charts.push(this);
    }

    visible() {
      return this.lines.filter((line) => !hidden.has(line.method));
    }

    draw() {
      const { axis, unit } = this.group;
      this.width = this.plot.clientWidth || 340;
      const width = this.width;
      const height = Math.round(Math.min(300, Math.max(200, width * 0.62)));
      const box = { left: 44, right: width - 18, top: 10, bottom: height - 36 };
      const top = this.group.highest();
      const span = axis.at(-1) - axis[0] || 1;
      this.x = (value) => box.left + ((value - axis[0]) / span) * (box.right - box.left);
      this.y = (value) => box.bottom - (value / top) * (box.bottom - box.top);
      this.box = box;
      const drawing = svg("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
      for (const value of ticks(0, top, 5)) {
        drawing.append(
          svg("line", { class: "grid", x1: box.left, x2: box.right, y1: this.y(value), y2: this.y(value) }),
          svg("text", { x: box.left - 6, y: this.y(value) + 4, "text-anchor": "end" }, String(+value.toPrecision(6))),
        );
      }
      for (const value of ticks(axis[0], axis.at(-1), width / 70)) {
        drawing.append(svg("text", { x: this.x(value), y: box.bottom + 16, "text-anchor": "middle" }, String(+value.toPrecision(6))));
      }
      if (this.group.across.diagonal) {
        drawing.append(svg("line", { class: "diagonal", x1: this.x(axis[0]), x2: this.x(axis.at(-1)), y1: this.y(axis[0]), y2: this.y(axis.at(-1)) }));
      }
      drawing.append(
        svg("line", { class: "axis", x1: box.left, x2: box.right, y1: box.bottom, y2: box.bottom }),
        svg("text", { class: "label", x: box.right, y: height - 4, "text-anchor": "end" }, this.group.across.label),
        svg("text", { class: "label", x: box.left + 4, y: box.top + 2 }, unit),
      );
      const lines = this.visible();
      for (const line of lines) drawing.append(this.band(line));
      if (singleSeeds) {
        for (const line of lines) {
          for (const [seed, values] of Object.entries(line.seeds ?? {})) {
            drawing.append(this.line(line.method, values, { class: "seed", "data-seed": seed }));
          }
        }
      }
      for (const line of lines) {
        const dash = methods.get(line.method).dash;
        drawing.append(this.line(line.method, line.mean, { class: "line", "stroke-dasharray": dash }));
      }
      this.marks = svg("g");
      drawing.append(this.marks);
      this.plot.replaceChildren(drawing, this.tip);
      this.point(false);
    }

    line(method, values, attributes) {
      const points = values.map((value, i) => (value === null ? null : [this.x(this.group.axis[i]), this.y(value)]));
      const colour = methods.get(method).colour;
      return svg("path", { "data-method": method, d: path(points), colour, ...attributes });
    }

    band(line) {
      const edge = (values, i) => [this.x(this.group.axis[i]), this.y(values[i])];
      let d = "";
      let run = [];
      const close = () => {
        if (run.length > 1) {
          const outline = [...run.map((i) => edge(line.high, i)), ...run.toReversed().map((i) => edge(line.low, i))];
          d += `${path(outline)}Z`;
        }
        run = [];
      };
      line.low.forEach((low, i) => (low === null ? close() : run.push(i)));
      close();
      return svg("path", { class: "band", "data-method": line.method, d, colour: methods.get(line.method).colour });
    }

    // Show the values at the group's cursor: marks on every chart, words on the active one.
    point(active) {
      const at = this.group.cursor;
      this.marks.replaceChildren();
      this.tip.hidden = true;
      const known = at === null ? [] : this.visible().filter((line) => line.mean[at] !== null);
      known.sort((a, b) => b.mean[at] - a.mean[at]);
      const spoken = at === null ? this.group.axis.length - 1 : at;
      this.plot.setAttribute("aria-valuenow", this.group.axis[spoken]);
      this.plot.setAttribute("aria-valuetext", this.words(known, spoken));
      if (at === null) return;
      const x = this.x(this.group.axis[at]);
      this.marks.append(svg("line", { class: "cursor", x1: x, x2: x, y1: this.box.top, y2: this.box.bottom }));
      for (const line of known) {
        const colour = methods.get(line.method).colour;
        this.marks.append(svg("circle", { class: "dot", cx: x, cy: this.y(line.mean[at]), r: 4, colour }));
      }
      if (!active) return;
      const rows = known.map((line) =>
        element(
          "tr",
          {},
          element("td", {}, key(line.method)),
          element("td", {}, line.method),
          element("td", { class: "number" }, shown(line.mean[at])),
          element("td", { class: "number muted" }, interval(line, at)),
        ),
      );
      const heading = `${this.group.across.say(this.group.axis[at])}${this.group.unit ? `, ${this.group.unit}` : ""}`;
      this.tip.replaceChildren(element("strong", {}, heading), element("table", {}, element("tbody", {}, ...rows)));
      this.tip.hidden = false;
      const room = this.width - this.tip.offsetWidth;
      const beside = x > this.width / 2 ? x - this.tip.offsetWidth - 12 : x + 12;
      this.tip.style.left = `${Math.max(0, Math.min(room, beside))}px`;
    }

    words(lines, at) {
      const values = lines.map((line) => `${line.method} ${shown(line.mean[at])} ${interval(line, at)}`.trim());
      return `${this.group.across.say(this.group.axis[at])}: ${values.join("; ")}`;
    }

    follow(event) {
      const x = event.clientX - this.plot.getBoundingClientRect().left;
      let best = 0;
      this.group.axis.forEach((value, i) => {
        if (Math.abs(this.x(value) - x) < Math.abs(this.x(this.group.axis[best]) - x)) best = i;
      });
      this.group.move(best, this);
    }

    key(event) {
      const last = this.group.axis.length - 1;
      const from = this.group.cursor ?? last;
      const targets = {
        ArrowLeft: from - 1,
        ArrowDown: from - 1,
        ArrowRight: from + 1,
        ArrowUp: from + 1,
        PageDown: from - 10,
        PageUp: from + 10,
        Home: 0,
        End: last,
      };
      if (event.key === "Escape") this.group.move(null);
      else if (event.key in targets) this.group.move(Math.max(0, Math.min(last, targets[event.key])), this);
      else return;
      event.preventDefault();
    }
  }

  function interval(line, at) {
    return line.low[at] === null ? "" : `[${shown(line.low[at])}, ${shown(line.high[at])}]`;
  }

  // A short piece of a method's line.
  function key(method) {
    const { colour, dash } = methods.get(method);
    const stroke = svg("path", { class: "line", d: "M1 6H29", "stroke-dasharray": dash, colour });
    return svg("svg", { class: "key", viewBox: "0 0 30 12", "aria-hidden": "true" }, stroke);
  }

  // Buttons that hide and show methods; all legends tell the same.
  function legend(host, names) {
    for (const name of names) {
      const button = element("button", { type: "button", "data-method": name }, key(name), name);
      press(button, !hidden.has(name));
      button.addEventListener("click", () => {
        if (!hidden.delete(name)) hidden.add(name);
        for (const twin of document.querySelectorAll(".legend button")) {
          press(twin, !hidden.has(twin.dataset.method));
        }
        for (const group of groups) group.draw();
      });
      host.append(button);
    }
  }

  function methodsOf(lines) {
    const present = new Set(lines.map((line) => line.method));
    return data.methods.map((method) => method.name).filter((name) => present.has(name));
  }

  function options(select, titles, chosen, choose) {
    titles.forEach((title, i) => select.append(element("option", { value: i }, title)));
    select.value = chosen;
    select.addEventListener("change", () => choose(Number(select.value)));
    choose(chosen);
  }

  // The sections.

  function curves() {
    const group = new Group(data.axis, { unit: `RMSE (${data.unit})` });
    const host = document.getElementById("curve-panels");
    for (const panel of data.panels) host.append(new Chart(group, panel.title, panel.lines).figure);
    legend(document.querySelector("[data-legend=curves]"), methodsOf(data.panels.flatMap((panel) => panel.lines)));
    group.draw();
    const seeds = document.getElementById("seeds");
    seeds.hidden = false;
    seeds.addEventListener("click", () => {
      singleSeeds = !singleSeeds;
      press(seeds, singleSeeds);
      group.draw();
    });
  }

  function calibration() {
    const host = document.getElementById("calibration-panels");
    if (!host) return;
    const { axis, panels } = data.calibration;
    const group = new Group(axis, { unit: "share of the map within", top: 1, across: LEVELS });
    for (const panel of panels) host.append(new Chart(group, panel.title, panel.lines).figure);
    legend(document.querySelector("[data-legend=calibration]"), methodsOf(panels.flatMap((panel) => panel.lines)));
    group.draw();
  }

  function detector() {
    const host = document.getElementById("quality-panels");
    if (!host) return;
    const { axis, panels } = data.quality;
    const lines = panels.flatMap((panel) => panel.charts.flatMap((chart) => chart.lines));
    legend(document.querySelector("[data-legend=quality]"), methodsOf(lines));
    const charts = panels[0].charts.map((chart) => {
      // Rates of false alarms are small: that chart has a scale of its own.
      const group = new Group(axis, { unit: "", top: chart.title === "False-alarm rate" ? 0 : 1 });
      const made = new Chart(group, chart.title, chart.lines);
      host.append(made.figure);
      return made;
    });
    const titles = panels.map((panel) => panel.title);
    options(document.getElementById("quality-choice"), titles, data.quality.first, (i) => {
      charts.forEach((chart, k) => {
        chart.lines = panels[i].charts[k].lines;
        chart.group.draw();
      });
    });
  }

  function places() {
    const host = document.getElementById("alarm-map");
    if (!host) return;
    const { image, extent, runs } = data.map;
    const [xmin, xmax, ymin, ymax] = extent;
    const side = 400;
    const tall = (side * (ymax - ymin)) / (xmax - xmin);
    const marks = { "false alarms": cross, "outliers caught": disc, "outliers missed": triangle };
    const off = new Set(["outliers missed"]);
    let run = runs[data.map.first];
    const layers = svg("g");
    const buttons = document.getElementById("alarm-layers");
    const counts = document.getElementById("alarm-counts");
    const drawing = svg(
      "svg",
      { viewBox: `-30 -8 ${side + 44} ${tall + 32}`, role: "img", "aria-describedby": "alarm-counts" },
      svg("image", { href: image, width: side, height: tall, preserveAspectRatio: "none" }),
      layers,
      svg("rect", { class: "frame", width: side, height: tall }),
    );
    for (const value of ticks(xmin, xmax, 5)) {
      const x = ((value - xmin) / (xmax - xmin)) * side;
      drawing.append(svg("text", { x, y: tall + 18, "text-anchor": "middle" }, String(value)));
    }
    for (const value of ticks(ymin, ymax, 5)) {
      const y = tall - ((value - ymin) / (ymax - ymin)) * tall;
      drawing.append(svg("text", { x: -6, y: y + 4, "text-anchor": "end" }, String(value)));
    }
    host.append(drawing);

    // Two digits to the base 36 for x and two for y, 1295 at the far border.
    function unpack(text) {
      const points = [];
      for (let i = 0; i < text.length; i += 4) {
        const x = parseInt(text.slice(i, i + 2), 36) / 1295;
        const y = parseInt(text.slice(i + 2, i + 4), 36) / 1295;
        points.push([+(x * side).toFixed(1), +((1 - y) * tall).toFixed(1)]);
      }
      return points;
    }

    function draw() {
      drawing.setAttribute("aria-label", `Map of ${run.panel}, ${run.method}`);
      layers.replaceChildren();
      for (const polygon of run.obstacles) {
        const points = polygon.map(([x, y]) =>
          [((x - xmin) / (xmax - xmin)) * side, (1 - (y - ymin) / (ymax - ymin)) * tall].map((value) => value.toFixed(1)).join());
        layers.append(svg("polygon", { class: "no-go", points: points.join(" ") }));
      }
      const words = [];
      for (const layer of [...run.layers].reverse()) {
        const points = unpack(layer.points);
        const share = layer.count > points.length ? `, ${points.length} of them shown` : "";
        const each = shown(layer.count / run.missions);
        words.unshift(`${layer.name}: ${layer.count}${run.missions > 1 ? ` (${each} a mission${share})` : ""}`);
        if (off.has(layer.name)) continue;
        const d = points.map(marks[layer.name]).join("");
        const kind = layer.name.replace(" ", "-");
        layers.append(svg("path", { class: `mark outline ${kind}`, d }), svg("path", { class: `mark ${kind}`, d }));
      }
      counts.textContent = `${words.join("; ")}.`;
      const body = document.getElementById("alarm-relief");
      body.replaceChildren(
        ...run.relief.map((row) =>
          element(
            "tr",
            {},
            element("th", { scope: "row" }, row.land),
            ...[shown(row.relief), shown(row.rmse), row.rate === null ? "–" : `${(100 * row.rate).toFixed(1)} %`].map(
              (text) => element("td", { class: "number" }, text),
            ),
          ),
        ),
      );
    }

    for (const { name } of run.layers) {
      const kind = name.replace(" ", "-");
      const d = marks[name]([8, 8]);
      const sign = svg("svg", { class: "key sign", viewBox: "4 4 8 8", "aria-hidden": "true" },
        svg("path", { class: `mark outline ${kind}`, d }), svg("path", { class: `mark ${kind}`, d }));
      const button = element("button", { type: "button", "data-layer": name }, sign, name);
      press(button, !off.has(name));
      button.addEventListener("click", () => {
        if (!off.delete(name)) off.add(name);
        press(button, !off.has(name));
        draw();
      });
      buttons.append(button);
    }
    const titles = runs.map((one) => `${one.panel}: ${one.method}`);
    options(document.getElementById("alarm-choice"), titles, data.map.first, (i) => {
      run = runs[i];
      draw();
    });
  }

  const cross = ([x, y]) => `M${x - 2} ${y - 2}l4 4m0-4l-4 4`;
  const disc = ([x, y]) => `M${x - 2} ${y}a2 2 0 1 0 4 0a2 2 0 1 0-4 0z`;
  const triangle = ([x, y]) => `M${x - 2.4} ${y - 1.8}h4.8l-2.4 4.2z`;

  theme();
  curves();
  calibration();
  detector();
  places();
  sorting();
  printing();
})();
