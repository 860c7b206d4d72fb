(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  knowMethods(data.methods);

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
