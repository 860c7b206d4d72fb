(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const bytes = (text) => Uint8Array.from(atob(text), (one) => one.charCodeAt(0));
  const singles = (text) => new Float32Array(bytes(text).buffer);
  const at = (id) => document.getElementById(id);

  const x = singles(data.samples.x);
  const y = singles(data.samples.y);
  const value = new Float64Array(bytes(data.samples.value).buffer);
  const row = new Int32Array(bytes(data.samples.row).buffer);
  const source = new Int32Array(bytes(data.samples.log).buffer);
  const { time } = data.samples;
  const later = data.samples.later && bytes(data.samples.later); // null if there is one log
  const { logs } = data; // empty if there is one alone
  const count = x.length;
  const detectors = data.detectors.map((one) => ({
    ...one,
    flagged: bytes(one.flagged),
    score: singles(one.score),
    expected: singles(one.expected),
  }));
  const layers = data.layers.map((one) => ({ ...one, values: singles(one.values) }));
  const [xmin, xmax, ymin, ymax] = data.extent;
  const track = { ...layers[0], title: data.value };

  const host = at("map");
  const canvas = host.querySelector("canvas");
  const pen = canvas.getContext("2d");
  const tip = at("tip");
  const view = { x: 0, y: 0, scale: 1, width: 1, height: 1, whole: true };
  let detector = detectors[0];
  let layer = layers[0];
  let pointed = -1; // the sample whose numbers are shown
  let kept = false; // it stays when the mouse moves on
  let waiting = false;

  // More points than that are not told apart when all of them are in view.
  const MOST_DRAWN = 8000;
  const FIRST_ROWS = 100;

  // Words

  // A measured value as the log has it; what is computed gets three digits.
  const measured = (one) => String(Number(one.toPrecision(12)));
  const computed = (one) => (Number.isNaN(one) ? "–" : shown(one));
  const withUnit = (text, unit) => (unit && text !== "–" ? `${text} ${unit}` : text);
  const inUnit = (title, unit) => (unit ? `${title} (${unit})` : title);

  function facts(i) {
    const unit = data.unit;
    const score = detector.score[i];
    const limit = detector.threshold;
    const told = [
      ["value", withUnit(measured(value[i]), unit)],
      ["expected", withUnit(computed(detector.expected[i]), unit)],
      ["score", Number.isNaN(score) ? "–" : computed(score)],
    ];
    if (limit !== null) told.push(["threshold", computed(limit)]);
    told.push(["row", String(row[i])]);
    if (logs.length) told.push(["log", logs[source[i]]]);
    if (time) told.push(["time", time[i] ?? "–"]);
    if (said(i)) told.push(["later logs", said(i)]);
    return told;
  }

  // What later logs say of a flag of the survey's own detector; empty if nothing.
  const said = (i) => (later && detector === detectors[0] ? data.later_words[later[i]] : "");
  const cleared = (i) => said(i) === "cleared";
  const marked = (i) => detector.flagged[i] || cleared(i);

  function heading(i) {
    const same = sharing(i);
    const verdict = `${detector.flagged[i] ? "flagged" : "not flagged"} by ${detector.name}`;
    return same.length > 1 ? `${verdict}; ${same.indexOf(i) + 1} of ${same.length} samples in this place` : verdict;
  }

  function place(east, north) {
    const [e, n] = [data.origin[0] + east, data.origin[1] + north];
    const plane = data.crs
      ? `easting ${e.toFixed(1)} m, northing ${n.toFixed(1)} m`
      : `x ${e.toFixed(1)} m, y ${n.toFixed(1)} m`;
    if (!data.degrees) return plane;
    const u = (2 * east - xmin - xmax) / (xmax - xmin);
    const v = (2 * north - ymin - ymax) / (ymax - ymin);
    const sum = (rows) => rows.reduce((all, one, i) => all + one.reduce((part, c, j) => part + c * u ** i * v ** j, 0), 0);
    const lat = sum(data.degrees.lat);
    const lon = ((((sum(data.degrees.lon) + 180) % 360) + 360) % 360) - 180;
    const side = (angle, letters) => `${Math.abs(angle).toFixed(6)}° ${letters[angle < 0 ? 1 : 0]}`;
    return `${plane}; ${side(lat, "NS")}, ${side(lon, "EW")}`;
  }

  // The view: which place is in the middle, and how many pixels a metre has.

  function fitting() {
    return 0.94 * Math.min(view.width / (xmax - xmin), view.height / (ymax - ymin));
  }

  function showAll() {
    Object.assign(view, { x: (xmin + xmax) / 2, y: (ymin + ymax) / 2, scale: fitting(), whole: true });
    draw();
  }

  const toScreen = (east, north) => [
    view.width / 2 + (east - view.x) * view.scale,
    view.height / 2 - (north - view.y) * view.scale,
  ];
  const toPlace = (left, top) => [
    view.x + (left - view.width / 2) / view.scale,
    view.y - (top - view.height / 2) / view.scale,
  ];

  function moveTo(east, north) {
    view.x = Math.min(xmax, Math.max(xmin, east));
    view.y = Math.min(ymax, Math.max(ymin, north));
    view.whole = false;
    draw();
  }

  // Zoom about a point of the screen; returns whether that was possible.
  function zoom(factor, left = view.width / 2, top = view.height / 2) {
    const least = 0.6 * fitting();
    const scale = Math.min(Math.max(400, least), Math.max(least, view.scale * factor));
    if (scale === view.scale) return false;
    const [east, north] = toPlace(left, top);
    view.scale = scale;
    moveTo(east - (left - view.width / 2) / scale, north + (top - view.height / 2) / scale);
    return true;
  }

  function resize() {
    const ratio = Math.min(devicePixelRatio || 1, 2);
    Object.assign(view, { width: host.clientWidth, height: host.clientHeight });
    canvas.width = Math.round(view.width * ratio);
    canvas.height = Math.round(view.height * ratio);
    canvas.style.width = `${view.width}px`;
    canvas.style.height = `${view.height}px`;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.lineCap = "round";
    if (view.whole) Object.assign(view, { x: (xmin + xmax) / 2, y: (ymin + ymax) / 2, scale: fitting() });
    paint();
  }

  // Drawing

  // Marks have the same colours in light and in dark.
  const properties = getComputedStyle(document.documentElement);
  const inks = new Map();
  function ink(name) {
    if (!inks.has(name)) inks.set(name, properties.getPropertyValue(`--${name}`).trim());
    return inks.get(name);
  }

  function colourOf({ low, high, palette }, number) {
    const share = (number - low) / (high - low || 1);
    return palette[Math.round(Math.min(1, Math.max(0, share)) * (palette.length - 1))];
  }

  // A layer as an image, a pixel a node, the north first.
  function imageOf(one) {
    if (one.image) return one.image;
    const { rows, columns } = data.grid;
    one.image = document.createElement("canvas");
    Object.assign(one.image, { width: columns, height: rows });
    const brush = one.image.getContext("2d");
    for (let r = 0; r < rows; r++) {
      for (let c = 0; c < columns; c++) {
        brush.fillStyle = colourOf(one, one.values[r * columns + c]);
        brush.fillRect(c, rows - 1 - r, 1, 1);
      }
    }
    return one.image;
  }

  function draw() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(paint);
  }

  function paint() {
    waiting = false;
    pen.clearRect(0, 0, view.width, view.height);
    if (layer.values) paintLayer();
    const inside = [];
    const reach = 12 / view.scale;
    const [west, north] = toPlace(0, 0);
    const [east, south] = toPlace(view.width, view.height);
    for (let i = 0; i < count; i++) {
      if (x[i] > west - reach && x[i] < east + reach && y[i] > south - reach && y[i] < north + reach) inside.push(i);
    }
    const each = Math.ceil(inside.length / MOST_DRAWN);
    paintTrack();
    paintSamples(each > 1 ? inside.filter((i) => i % each === 0) : inside);
    for (const i of inside) {
      if (cleared(i) || said(i) === "confirmed") frame(...toScreen(x[i], y[i]));
      if (detector.flagged[i]) cross(...toScreen(x[i], y[i]));
    }
    at("thinned").textContent = each > 1
      ? `${inside.length} samples in view: one in ${each} is drawn, and all flagged ones; zoom in to see the others.`
      : "";
    if (pointed >= 0) ring(...toScreen(x[pointed], y[pointed]));
    scaleBar();
    placeTip();
  }

  function paintLayer() {
    const { rows, columns } = data.grid;
    const halfX = (xmax - xmin) / (columns - 1) / 2;
    const halfY = (ymax - ymin) / (rows - 1) / 2;
    const [left, top] = toScreen(xmin - halfX, ymax + halfY);
    const [right, bottom] = toScreen(xmax + halfX, ymin - halfY);
    pen.save();
    pen.beginPath();
    pen.rect(...toScreen(xmin, ymax), (xmax - xmin) * view.scale, (ymax - ymin) * view.scale);
    pen.clip();
    pen.drawImage(imageOf(layer), left, top, right - left, bottom - top);
    pen.restore();
  }

  // The way from sample to sample; what is less than a pixel away is passed over.
  function paintTrack() {
    pen.beginPath();
    let [lastX, lastY] = [NaN, NaN];
    for (let i = 0; i < count; i++) {
      const [left, top] = toScreen(x[i], y[i]);
      const begins = i === 0 || source[i] !== source[i - 1];
      if (!begins && Math.abs(left - lastX) < 1 && Math.abs(top - lastY) < 1) continue;
      if (begins) pen.moveTo(left, top);
      else pen.lineTo(left, top);
      [lastX, lastY] = [left, top];
    }
    pen.lineWidth = 1;
    pen.strokeStyle = "rgb(127 134 143 / 0.8)";
    pen.stroke();
  }

  function paintSamples(chosen) {
    const size = Math.min(5.5, Math.max(2.2, 1.6 * Math.sqrt(view.scale / fitting()) + 1));
    // The outline stands out from what lies below, whatever the colour of the sample.
    pen.strokeStyle = { deviation: "rgb(255 255 255 / 0.85)", none: "rgb(127 134 143)" }[layer.name] ?? "rgb(16 32 46 / 0.75)";
    pen.lineWidth = 0.8;
    for (const i of chosen) {
      const [left, top] = toScreen(x[i], y[i]);
      pen.fillStyle = colourOf(track, value[i]);
      pen.beginPath();
      pen.arc(left, top, size, 0, 2 * Math.PI);
      pen.fill();
      if (chosen.length < 3000) pen.stroke();
    }
  }

  function cross(left, top) {
    for (const [width, colour] of [[5, ink("rim")], [2.2, ink("flagged")]]) {
      pen.beginPath();
      pen.moveTo(left - 5, top - 5);
      pen.lineTo(left + 5, top + 5);
      pen.moveTo(left + 5, top - 5);
      pen.lineTo(left - 5, top + 5);
      pen.lineWidth = width;
      pen.strokeStyle = colour;
      pen.stroke();
    }
  }

  // A later log has been here.
  function frame(left, top) {
    for (const [width, colour] of [[5, ink("rim")], [2.2, ink("revisited")]]) {
      pen.lineWidth = width;
      pen.strokeStyle = colour;
      pen.strokeRect(left - 8, top - 8, 16, 16);
    }
  }

  function ring(left, top) {
    for (const [width, colour] of [[5, ink("rim")], [2.2, ink("caught")]]) {
      pen.beginPath();
      pen.arc(left, top, 10, 0, 2 * Math.PI);
      pen.lineWidth = width;
      pen.strokeStyle = colour;
      pen.stroke();
    }
  }

  // A length of 1, 2 or 5 times a power of ten, at most 140 pixels.
  function scaleBar() {
    const most = 140 / view.scale;
    const power = 10 ** Math.floor(Math.log10(most));
    const metres = [5, 2, 1].map((unit) => unit * power).find((one) => one <= most);
    at("scale-bar").style.width = `${metres * view.scale}px`;
    at("scale-text").textContent = metres >= 1000 ? `${metres / 1000} km` : `${+metres.toPrecision(1)} m`;
  }

  function bar(one, title) {
    const stops = one.palette.map((colour, i) => `${colour} ${(100 * i) / (one.palette.length - 1)}%`);
    const strip = element("div", { class: "bar", role: "img", "aria-label": `${title}: ${shown(one.low)} to ${shown(one.high)}` });
    strip.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
    for (const number of ticks(one.low, one.high, 5)) {
      const mark = element("span", {}, String(+number.toPrecision(6)));
      mark.style.left = `${(100 * (number - one.low)) / (one.high - one.low || 1)}%`;
      strip.append(mark);
    }
    const [least, most] = one.range;
    const farther = least < one.low || most > one.high;
    const beyond = farther ? [element("p", { class: "muted beyond" }, `The map goes from ${shown(least)} to ${shown(most)}, farther than the colours.`)] : [];
    return element("div", {}, title, strip, ...beyond);
  }

  function bars() {
    const there = [];
    if (layer.values && layer.name !== "mean") there.push(bar(layer, inUnit(layer.title, layer.unit)));
    const what = layer.name === "mean" ? `${track.title}, and ${layer.title}` : track.title;
    const range = layer.name === "mean" ? track.range : [track.low, track.high];
    there.push(bar({ ...track, range }, inUnit(what, track.unit)));
    at("bars").replaceChildren(...there);
  }

  // Which sample is meant

  // All in the place of a sample, flagged ones first.
  function sharing(i) {
    const found = [];
    for (let k = 0; k < count; k++) if (x[k] === x[i] && y[k] === y[i]) found.push(k);
    return found.sort((a, b) => detector.flagged[b] - detector.flagged[a] || a - b);
  }

  function nearest(left, top, reach) {
    const [east, north] = toPlace(left, top);
    let best = -1;
    let least = (reach / view.scale) ** 2;
    for (let i = 0; i < count; i++) {
      const away = (x[i] - east) ** 2 + (y[i] - north) ** 2;
      if (away < least || (away === least && best >= 0 && detector.flagged[i] > detector.flagged[best])) {
        [best, least] = [i, away];
      }
    }
    return best;
  }

  function point(i, keep) {
    pointed = i;
    kept = keep && i >= 0;
    tip.hidden = i < 0;
    if (i >= 0) {
      const cells = facts(i).map(([name, text]) => element("tr", {}, element("td", { class: "muted" }, name), element("td", {}, text)));
      tip.replaceChildren(element("strong", {}, heading(i)), element("table", {}, element("tbody", {}, ...cells)));
    }
    if (kept) at("spoken").textContent = `${heading(i)}: ${facts(i).map((pair) => pair.join(" ")).join(", ")}`;
    else if (i < 0) at("spoken").textContent = "";
    for (const one of at("flag-table").tBodies[0].rows) one.classList.toggle("kept", kept && Number(one.dataset.sample) === i);
    draw();
  }

  function placeTip() {
    if (tip.hidden) return;
    const [left, top] = toScreen(x[pointed], y[pointed]);
    const [width, height] = [tip.offsetWidth, tip.offsetHeight];
    const beside = left > view.width / 2 ? left - width - 16 : left + 16;
    const room = (size, most) => Math.max(2, Math.min(size, most - 2));
    tip.style.left = `${room(beside, view.width - width)}px`;
    // On a narrow screen there is no room beside the sample, but below or above it.
    const narrow = width + 40 > view.width / 2;
    const beyond = top > view.height / 2 ? top - height - 16 : top + 16;
    tip.style.top = `${room(narrow ? beyond : top - height / 2, view.height - height)}px`;
  }

  function click(left, top, reach) {
    const found = nearest(left, top, reach);
    const same = found < 0 ? [] : sharing(found);
    const before = kept ? same.indexOf(pointed) : -1;
    point(same.length ? same[(before + 1) % same.length] : -1, true);
  }

  // Bring a sample into the middle.
  function goTo(i, closer) {
    if (closer) view.scale = Math.max(view.scale, 4 * fitting());
    moveTo(x[i], y[i]);
    point(i, true);
    tellPlace(x[i], y[i], "middle");
  }

  // Keep a sample; the map moves only if it is near the border or beyond it.
  function show(i) {
    const [left, top] = toScreen(x[i], y[i]);
    const inside = (at, size) => at > 0.1 * size && at < 0.9 * size;
    if (inside(left, view.width) && inside(top, view.height)) point(i, true);
    else goTo(i, false);
  }

  function step(by, flaggedOnly) {
    let i = pointed < 0 ? (by > 0 ? -1 : count) : pointed;
    do i += by;
    while (i >= 0 && i < count && flaggedOnly && !marked(i));
    if (i >= 0 && i < count) show(i);
  }

  function tellPlace(east, north, what) {
    at("position").textContent = `${what}: ${place(east, north)}`;
  }

  // Mouse, fingers, keys

  function hands() {
    const down = new Map();
    let moved = false;
    const spot = (event) => {
      const box = host.getBoundingClientRect();
      return [event.clientX - box.left - host.clientLeft, event.clientY - box.top - host.clientTop];
    };
    const middle = (spots) => [0, 1].map((k) => spots.reduce((sum, one) => sum + one[k], 0) / spots.length);
    const apart = ([a, b]) => Math.hypot(a[0] - b[0], a[1] - b[1]);
    const onMap = (event) => !event.target.closest("button");

    host.addEventListener("pointerdown", (event) => {
      if (!onMap(event) || (event.pointerType === "mouse" && event.button !== 0)) return;
      if (down.size === 0) moved = false;
      down.set(event.pointerId, { first: spot(event), now: spot(event) });
      host.setPointerCapture(event.pointerId);
    });
    host.addEventListener("pointermove", (event) => {
      const here = spot(event);
      if (event.pointerType === "mouse") tellPlace(...toPlace(...here), "pointer");
      const one = down.get(event.pointerId);
      if (!one) {
        if (!kept && event.pointerType === "mouse") {
          const found = onMap(event) ? nearest(...here, 14) : -1;
          if (found !== pointed) point(found, false);
        }
        return;
      }
      if (apart([one.first, here]) > 5 || down.size > 1) moved = true;
      const before = [...down.values()].map((each) => each.now);
      one.now = here;
      if (!moved) return;
      host.classList.add("dragged");
      const after = [...down.values()].map((each) => each.now);
      const [from, to] = [middle(before), middle(after)];
      moveTo(view.x - (to[0] - from[0]) / view.scale, view.y + (to[1] - from[1]) / view.scale);
      if (after.length > 1) zoom(apart(after) / Math.max(1, apart(before)), ...to);
      if (event.pointerType !== "mouse") tellPlace(view.x, view.y, "middle");
    });
    const lift = (event) => {
      const one = down.get(event.pointerId);
      if (!one) return;
      down.delete(event.pointerId);
      if (down.size === 0) host.classList.remove("dragged");
      if (event.type === "pointerup" && !moved) {
        click(...one.now, event.pointerType === "mouse" ? 14 : 26);
        if (event.pointerType !== "mouse") tellPlace(...toPlace(...one.now), "finger");
      }
    };
    host.addEventListener("pointerup", lift);
    host.addEventListener("pointercancel", lift);
    host.addEventListener("pointerleave", () => {
      if (!kept && pointed >= 0 && down.size === 0) point(-1, false);
    });
    // Where nothing more can be zoomed, the wheel is the page's.
    host.addEventListener(
      "wheel",
      (event) => {
        const pixels = event.deltaY * [1, 30, 300][event.deltaMode];
        if (zoom(Math.exp(-0.002 * pixels), ...spot(event))) event.preventDefault();
      },
      { passive: false },
    );
  }

  function keys() {
    const part = 0.15;
    host.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || event.target !== host) return;
      const wide = (part * view.width) / view.scale;
      const high = (part * view.height) / view.scale;
      const does = {
        ArrowLeft: () => moveTo(view.x - wide, view.y),
        ArrowRight: () => moveTo(view.x + wide, view.y),
        ArrowUp: () => moveTo(view.x, view.y + high),
        ArrowDown: () => moveTo(view.x, view.y - high),
        "+": () => zoom(1.5),
        "=": () => zoom(1.5),
        "-": () => zoom(1 / 1.5),
        0: showAll,
        n: () => step(1, false),
        p: () => step(-1, false),
        N: () => step(1, true),
        P: () => step(-1, true),
        Escape: () => point(-1, false),
      }[event.key];
      if (!does) return;
      event.preventDefault();
      does();
      tellPlace(view.x, view.y, "middle");
    });
    const buttons = {
      closer: () => zoom(1.5),
      farther: () => zoom(1 / 1.5),
      whole: showAll,
      next: () => step(1, false),
      previous: () => step(-1, false),
      "next-flag": () => step(1, true),
      "previous-flag": () => step(-1, true),
    };
    for (const [id, does] of Object.entries(buttons)) at(id).addEventListener("click", does);
  }

  // Switches

  function choice(id, names, choose) {
    const buttons = names.map((name) => element("button", { type: "button" }, name));
    buttons.forEach((button, i) => {
      button.addEventListener("click", () => {
        buttons.forEach((other) => press(other, other === button));
        choose(i);
      });
      press(button, i === 0);
    });
    at(id).append(...buttons);
  }

  function switches() {
    const flags = (one) => one.flagged.reduce((sum, flag) => sum + flag, 0);
    choice("detector-choice", detectors.map((one) => `${one.name}: ${flags(one)}`), (i) => {
      detector = detectors[i];
      list.fill();
      point(pointed, kept);
    });
    layers.push({ name: "none", title: "track alone" });
    choice("layer-choice", layers.map((one) => one.title), (i) => {
      layer = layers[i];
      bars();
      draw();
    });
  }

  // The list of flagged samples

  const words = new Set(["log", "time", "later logs"]); // columns that are no numbers

  const list = {
    column: -1,
    up: false,
    all: false,
    columns: [
      ["row", (i) => row[i], (i) => String(row[i])],
      ...(logs.length ? [["log", (i) => source[i], (i) => logs[source[i]]]] : []),
      ...(time ? [["time", (i) => i, (i) => time[i] ?? "–"]] : []),
      [inUnit("value", data.unit), (i) => value[i], (i) => measured(value[i])],
      ["expected", (i) => detector.expected[i], (i) => computed(detector.expected[i])],
      ["difference", (i) => value[i] - detector.expected[i], (i) => computed(value[i] - detector.expected[i])],
      ["score", (i) => detector.score[i], (i) => computed(detector.score[i])],
      ...(later ? [["later logs", (i) => data.later_words.indexOf(said(i)), (i) => said(i) || "–"]] : []),
    ],

    begin() {
      const headings = list.columns.map(([name], k) =>
        element("th", { scope: "col", class: k && !words.has(name) ? "number" : "" }, name));
      at("flag-table").tHead.rows[0].append(...headings);
      list.column = list.columns.findIndex(([name]) => name === "score");
      headings[list.column].setAttribute("aria-sort", "descending");
      sortBy(headings, (column, up) => {
        Object.assign(list, { column, up });
        list.fill();
      });
      at("all-flags").addEventListener("click", () => {
        list.all = true;
        list.fill();
      });
      list.fill();
    },

    fill() {
      const key = list.columns[list.column][1];
      const found = [];
      for (let i = 0; i < count; i++) if (marked(i)) found.push(i);
      // What has no number comes last, whichever way.
      const compare = (a, b) => Number.isNaN(key(a)) - Number.isNaN(key(b)) || (key(a) - key(b)) * (list.up ? 1 : -1) || a - b;
      found.sort(compare);
      const told = list.all ? found : found.slice(0, FIRST_ROWS);
      at("flag-table").tBodies[0].replaceChildren(...told.map(list.line));
      const flags = detector.flagged.reduce((sum, flag) => sum + flag, 0);
      at("flags-caption").textContent = `${flags} of ${count} samples are flagged by ${detector.name}`
        + list.counted() + (told.length < found.length ? `; ${told.length} are listed` : "");
      at("marks").hidden = !later || detector !== detectors[0];
      at("all-flags").hidden = told.length === found.length;
      at("all-flags").textContent = `List all ${found.length}`;
    },

    // How many of the flags before later logs came these confirm, clear, or leave.
    counted() {
      if (!later || detector !== detectors[0]) return "";
      const told = data.later_words.slice(1).map((word, k) => `${later.filter((one) => one === k + 1).length} ${word}`);
      return `; later logs have left ${told.join(", ")}`;
    },

    line(i) {
      const button = element("button", { type: "button", "aria-label": `Show row ${row[i]} on the map` }, String(row[i]));
      button.addEventListener("click", () => {
        goTo(i, true);
        at("place").scrollIntoView({ block: "start" });
      });
      const cells = list.columns.slice(1).map(([name, , text]) =>
        element("td", { class: words.has(name) ? "" : "number" }, text(i)));
      return element("tr", { "data-sample": i, class: kept && pointed === i ? "kept" : "" },
        element("th", { scope: "row" }, button), ...cells);
    },
  };

  // Paper is narrower than most screens: the map is drawn for it.
  function paper() {
    addEventListener("beforeprint", () => {
      host.style.width = "640px";
      resize();
    });
    addEventListener("afterprint", () => {
      host.style.width = "";
      resize();
    });
  }

  theme();
  switches();
  bars();
  list.begin();
  hands();
  keys();
  sorting();
  printing();
  paper();
  at("belongs").textContent = data.belongs;
  new ResizeObserver(resize).observe(host);
  resize();
  tellPlace(view.x, view.y, "middle");
})();
