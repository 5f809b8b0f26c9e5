"use strict";
// Draws the figures in the colours of the theme, and again where the theme changes.
(() => {
  const source = document.getElementById("figures");
  if (!source || !window.Plotly) return;
  const figures = JSON.parse(source.textContent);
  const isCoarse = matchMedia("(pointer: coarse)").matches;
  const cursors = [];

  function theme() {
    const style = getComputedStyle(document.documentElement);
    const of = (name) => style.getPropertyValue(name).trim();
    return {
      text: of("--text"), faint: of("--faint"), line: of("--line"), card: of("--card"),
      accent: of("--accent"), bad: of("--bad"), matrix: of("--matrix"),
      series: of("--series").split(/\s+/),
    };
  }

  function colored(trace, colors) {
    const meta = trace.meta || {};
    if (meta.is_matrix) {
      const text = { color: colors.text, size: 15 };
      return { ...trace, colorscale: [[0, colors.card], [1, colors.matrix]], textfont: text };
    }
    const color = colors.series[(meta.color || 0) % colors.series.length];
    return { ...trace, line: { ...trace.line, color }, marker: { ...trace.marker, color } };
  }

  function themed(figure, colors, width) {
    const axis = { gridcolor: colors.line, linecolor: colors.line, tickcolor: colors.line };
    const layout = { ...figure.layout };
    layout.font = { color: colors.text, size: 13, family: getComputedStyle(document.body).fontFamily };
    layout.paper_bgcolor = layout.plot_bgcolor = "rgba(0,0,0,0)";
    layout.xaxis = { ...axis, ...layout.xaxis };
    layout.yaxis = { ...axis, ...layout.yaxis };
    layout.hoverlabel = { bgcolor: colors.card, bordercolor: colors.line, font: { color: colors.text } };
    layout.shapes = (layout.shapes || []).map((s) => ({ ...s, line: { ...s.line, color: colors.bad } }));
    layout.annotations = (layout.annotations || []).map((a) => ({ ...a, font: { color: colors.bad } }));
    // The legend above a figure takes rows of its own.
    const names = layout.showlegend === false ? [] : figure.data.map((trace) => trace.name || "");
    const columns = Math.max(Math.floor(width / (45 + 8 * Math.max(0, ...names.map((n) => n.length)))), 1);
    layout.height += 20 * Math.ceil(names.length / columns);
    // A finger scrolls the page, and does not zoom.
    if (isCoarse) layout.dragmode = false;
    return { data: figure.data.map((trace) => colored(trace, colors)), layout };
  }

  const config = { responsive: true, displaylogo: false, displayModeBar: isCoarse ? false : "hover" };

  function draw() {
    const colors = theme();
    cursors.length = 0;
    for (const [name, figure] of Object.entries(figures)) {
      const place = document.getElementById(name);
      const { data, layout } = themed(figure, colors, place.clientWidth);
      if (layout.meta && layout.meta.has_cursor) {
        const line = { color: colors.faint, width: 1.5 };
        layout.shapes = [...layout.shapes, { type: "line", yref: "paper", y0: 0, y1: 1, x0: 0, x1: 0, line, name: "cursor" }];
        cursors.push({ place, index: layout.shapes.length - 1 });
      }
      Plotly.react(place, data, layout, config);
      if (layout.meta && layout.meta.has_cursor && !place.dataset.seeks) {
        place.dataset.seeks = "yes";
        place.on("plotly_click", (event) => document.dispatchEvent(
          new CustomEvent("seek", { detail: event.points[0].x })));
      }
    }
    if (shown !== null) mark(shown);
  }

  let shown = null, isWaiting = false;
  function mark(frame) {
    shown = frame;
    if (isWaiting) return;
    isWaiting = true;
    requestAnimationFrame(() => {
      isWaiting = false;
      for (const { place, index } of cursors) {
        const box = place.getBoundingClientRect();
        const isVisible = box.bottom > 0 && box.top < innerHeight;
        if (isVisible) Plotly.relayout(place, { [`shapes[${index}].x0`]: shown, [`shapes[${index}].x1`]: shown });
      }
    });
  }

  document.addEventListener("frame", (event) => mark(event.detail));
  addEventListener("scroll", () => { if (shown !== null) mark(shown); }, { passive: true });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  draw();
  document.documentElement.dataset.plots = "drawn";
})();
