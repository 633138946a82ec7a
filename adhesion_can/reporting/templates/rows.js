// Names of rows: beside the rows where there is room, in a narrow figure above each of them.

const BESIDE = 0.3; // share of the width that names beside the rows may take
const ROW_PX = { bar: 46, scatter: 36 }; // height of a row with its name above
const NAMED_FROM = -0.75, NAMED_TO = -0.45; // ends of an ordinate beyond its rows, in rows

// Place and name of each row of an ordinate; [] where it has numbers, or its rows go upwards.
function rowNames(data, axis, suffix) {
  const downwards = axis.autorange === "reversed" || (axis.range && axis.range[0] > axis.range[1]);
  if (!downwards) return [];
  if (axis.ticktext) return axis.ticktext.map((text, row) => [axis.tickvals[row], text]);
  if (axis.type !== "category") return [];
  const own = data.filter((trace) => (trace.yaxis || "y") === `y${suffix}`);
  const names = axis.categoryarray || [...new Set(own.flatMap((trace) => trace.y).filter((name) => typeof name === "string"))];
  return names.map((name) => [name, name]);
}

// Put the names of rows above them where they would take too much of the width.
function nameRowsAbove(full, data, wide, isPanel, colours) {
  for (const key of Object.keys(full).filter((name) => /^yaxis\d*$/.test(name))) {
    const axis = full[key], suffix = key.slice(5), names = rowNames(data, axis, suffix);
    const longest = Math.max(0, ...names.map(([, text]) => text.replace(/<[^>]*>/g, "").length));
    if (!names.length || (!isPanel && 7 * longest < BESIDE * wide)) continue;
    const kind = data.some((trace) => trace.type === "bar") ? "bar" : "scatter";
    Object.assign(axis, { showticklabels: false, ticks: "", automargin: false, autorange: false, range: [names.length + NAMED_TO, NAMED_FROM] });
    if (!isPanel) {
      const { t, b } = full.margin;
      full.height = ROW_PX[kind] * (names.length + NAMED_TO - NAMED_FROM) + t + b;
      full.margin = { ...full.margin, l: 16, r: 16 };
      if (kind === "bar") full.bargap = 0.55;
    }
    const lift = kind === "bar" ? 11 : 5;
    full.annotations = [
      ...(full.annotations || []),
      ...names.map(([y, text]) => ({ x: 0, xref: `x${suffix} domain`, xanchor: "left", y, yref: `y${suffix}`, yanchor: "bottom", yshift: lift, borderpad: 0, text, showarrow: false, bgcolor: colours.paper, font: { size: 11, color: colours.ink } })),
    ];
  }
}
