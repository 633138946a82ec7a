// Panels over one abscissa: their headings, and a cursor that reads every trace at one abscissa.
// Plotly draws and links the panels; what is read are the points that it draws.

const NARROW = 560, BELOW = 52; // px: width of a narrow figure, room for the abscissa
const GAP_STEPS = 5; // mean steps beyond its ends over which a trace still has a value

// Points of a trace in the order of its abscissa; a band has two ends for each, a state its spans.
function readable(trace) {
  const rows = [];
  if (trace.fill === "toself") {
    // An outline goes forth along the upper end and back along the lower one.
    let part = [];
    const end = () => {
      for (let k = 0; k < part.length / 2; k++) rows.push([part[k][0], part[part.length - 1 - k][1], part[k][1]]);
      part = [];
    };
    trace.x.forEach((x, k) => (x === null ? end() : part.push([x, trace.y[k]])));
    end();
    return { kind: "band", rows };
  }
  if (trace.y.some((y) => typeof y === "string")) {
    for (let k = 0; k + 1 < trace.x.length; k += 3) rows.push([trace.x[k], trace.x[k + 1]]);
    return { kind: "state", rows };
  }
  trace.x.forEach((x, k) => { if (x !== null) rows.push([x, trace.y[k]]); });
  return { kind: trace.line && trace.line.shape === "hv" ? "held" : "line", rows };
}

function short(value) {
  if (value === null) return "–";
  const size = Math.abs(value);
  const text = size > 0 && size < 1e-4 ? value.toExponential(2) : String(Number(value.toPrecision(5)));
  return text.replaceAll("-", "−");
}

// Text of what a trace shows at an abscissa; "" for a state that does not hold there.
function readAt({ kind, rows }, at, name) {
  if (kind === "state") return rows.some(([from, to]) => from <= at && at <= to) ? name : "";
  if (!rows.length) return "–";
  let low = 0, high = rows.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rows[middle][0] <= at) low = middle + 1; else high = middle;
  }
  const before = low - 1, ends = [rows[0][0], rows[rows.length - 1][0]];
  const reach = (GAP_STEPS * (ends[1] - ends[0])) / Math.max(rows.length - 1, 1);
  if (at < ends[0] - reach || at > ends[1] + reach) return "–";
  let nearest = Math.max(before, 0);
  if (kind !== "held" && low < rows.length && (before < 0 || rows[low][0] - at < at - rows[before][0])) nearest = low;
  const [x, first, second] = rows[nearest];
  // Where the estimate has a gap its band has no row.
  if (kind === "band" && Math.abs(x - at) > (0.75 * reach) / GAP_STEPS) return "–";
  if (kind === "band") return first === second ? short(first) : `${short(first)} to ${short(second)}`;
  // Both extremes of a span of setpoints have its middle as their abscissa.
  const other = [nearest - 1, nearest + 1].find((k) => k >= 0 && k < rows.length && rows[k][0] === x);
  if (other === undefined || rows[other][1] === first || first === null) return short(first);
  return [first, rows[other][1]].sort((a, b) => a - b).map(short).join(" to ");
}

class Cursor {
  constructor(figure, stage, target, data, layout, heights) {
    this.stage = stage;
    this.target = target;
    this.heights = heights;
    this.layout = layout;
    this.line = stage.querySelector(".cursor-line");
    this.slider = figure.querySelector(".cursor input");
    this.output = figure.querySelector(".cursor output");
    this.reads = [];
    this.heads = heights.map((_, row) => this.head(row, data));
    this.title = this.layout[`xaxis${heights.length > 1 ? heights.length : ""}`].title.text;
    figure.querySelector(".cursor-name").textContent = this.title;
    stage.onpointermove = (event) => this.follow(event);
    stage.onpointerdown = (event) => this.follow(event);
    this.slider.oninput = () => this.move(Number(this.slider.value));
  }

  // Heading of a panel: its quantity, and a button with the value of each trace, which hides it.
  head(row, data) {
    const suffix = row ? String(row + 1) : "";
    const head = document.createElement("div");
    head.className = "head";
    const title = document.createElement("b");
    title.innerHTML = this.layout[`yaxis${suffix}`].title.text; // our own text; Plotly's <sub> is HTML's
    head.append(title);
    const states = document.createElement("span");
    states.className = "value";
    data.forEach((trace, index) => {
      if (trace.yaxis !== `y${suffix}`) return;
      const read = readable(trace);
      if (read.kind === "state") {
        this.reads.push({ read, name: trace.name, states, held: [] });
        return;
      }
      const button = document.createElement("button");
      const swatch = document.createElement("i"), value = document.createElement("span");
      button.type = "button";
      button.setAttribute("aria-pressed", "true");
      button.title = "hide or show";
      swatch.style.background = trace.line.color;
      if (trace.fill) swatch.className = "area";
      // A panel of one trace has its name in front.
      const named = title.textContent.startsWith(trace.name) ? "" : trace.name;
      button.setAttribute("aria-label", trace.name);
      value.className = trace.fill ? "value wide" : "value";
      button.append(swatch, named, value);
      button.onclick = () => {
        const shown = button.getAttribute("aria-pressed") === "false";
        button.setAttribute("aria-pressed", String(shown));
        Plotly.restyle(this.target, { visible: shown ? true : "legendonly" }, [index]);
      };
      head.append(button);
      this.reads.push({ read, name: trace.name, value });
    });
    if (this.reads.some((one) => one.states === states)) head.append(states);
    this.stage.querySelector(".heads").append(head);
    return head;
  }

  // After the panels were drawn: follow a zoom, and another width of the window.
  start() {
    this.target.removeAllListeners("plotly_relayout");
    this.target.on("plotly_relayout", () => this.show());
    this.width = this.stage.clientWidth;
    if (this.stage.observer) this.stage.observer.disconnect();
    this.stage.observer = new ResizeObserver(() => this.resize());
    this.stage.observer.observe(this.stage);
    this.move(this.stage.cursorAt ?? this.area().range[0]);
  }

  resize() {
    if (this.stage.clientWidth === this.width) return;
    this.width = this.stage.clientWidth;
    const full = this.place({ margin: { ...this.target.layout.margin } });
    const changes = { height: full.height, width: this.width, "margin.t": full.margin.t };
    for (const [name, axis] of Object.entries(full)) if (axis.domain) changes[`${name}.domain`] = axis.domain;
    Plotly.relayout(this.target, changes).then(() => this.show());
  }

  // Put each panel of Plotly's layout below its heading, at the present width.
  place(full) {
    const tops = [];
    let y = 0;
    this.heads.forEach((head, row) => {
      head.style.top = `${y}px`;
      y += head.offsetHeight;
      tops.push(y);
      y += this.heights[row] + 4;
    });
    const first = tops[0], plot = y - 4 - first;
    this.heads.forEach((_, row) => {
      const name = `yaxis${row ? row + 1 : ""}`;
      const top = 1 - (tops[row] - first) / plot;
      full[name] = { ...full[name], title: { text: "" }, domain: [Math.max(top - this.heights[row] / plot, 0), top] };
    });
    this.line.style.height = `${y - 4}px`;
    // Plotly must not move the panels away from their headings.
    for (const name of Object.keys(full)) if (/^xaxis/.test(name)) full[name].automargin = false;
    full.margin = { ...full.margin, t: first, b: BELOW };
    full.height = first + plot + full.margin.b;
    full.hovermode = false;
    full.showlegend = false;
    return full;
  }

  // Plotted area of the panels in the window, px, and range of the abscissa.
  area() {
    const box = this.target.querySelector(".nsewdrag").getBoundingClientRect();
    return { left: box.left, width: box.width, range: this.target.layout.xaxis.range.map(Number) };
  }

  follow(event) {
    const { left, width, range } = this.area();
    if (event.clientX < left - 8 || event.clientX > left + width + 8) return;
    const share = Math.min(Math.max((event.clientX - left) / width, 0), 1);
    this.move(range[0] + share * (range[1] - range[0]));
  }

  move(at) {
    this.at = this.stage.cursorAt = at;
    const digits = Math.max(0, Math.min(6, 3 - Math.floor(Math.log10(Math.abs(this.area().range[1] - this.area().range[0]) || 1))));
    this.output.textContent = at.toFixed(digits);
    this.slider.value = at;
    const held = new Map();
    for (const { read, name, value, states } of this.reads) {
      const text = readAt(read, at, name);
      if (value) value.textContent = text;
      else held.set(states, [...(held.get(states) || []), ...(text ? [text] : [])]);
    }
    for (const [states, names] of held) states.textContent = names.join(", ");
    this.show();
  }

  // Put line and slider where the abscissa is, after a zoom as well.
  show() {
    const { left, width, range } = this.area();
    [this.slider.min, this.slider.max] = range;
    this.slider.step = (range[1] - range[0]) / 2000;
    if (this.at === undefined) return;
    const share = (this.at - range[0]) / (range[1] - range[0]);
    this.line.hidden = share < 0 || share > 1;
    this.line.style.left = `${left - this.stage.getBoundingClientRect().left + share * width}px`;
  }
}
