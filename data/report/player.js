"use strict";
// Shows the frames of a drive: slider, buttons, keys, and the objects of the frame as a table.
(() => {
  const source = document.getElementById("frames");
  if (!source) return;
  const { rate_hz: rateHz, columns, frames } = JSON.parse(source.textContent);
  const player = document.querySelector("[data-player]");
  const find = (selector) => player.querySelector(selector);
  const images = [...player.querySelectorAll(".view img")];
  const slider = find("input[type=range]"), output = find("output");
  const play = find("[data-play]"), speed = find("select"), rows = find(".objects tbody");
  let current = -1, timer = null;

  function cells(values) {
    const row = document.createElement("tr");
    values.forEach((value, column) => {
      const cell = document.createElement(column ? "td" : "th");
      if (!column) cell.scope = "row";
      cell.textContent = value === null ? "-" : value;
      row.append(cell);
    });
    return row;
  }

  function show(number) {
    number = Math.min(Math.max(number, 0), frames.length - 1);
    if (number === current) return;
    current = number;
    const frame = frames[number];
    images.forEach((image, view) => {
      image.src = frame.images[view] || "data:,";
      image.alt = `${image.dataset.view}, frame ${frame.frame}`;
    });
    const words = `frame ${frame.frame}, ${frame.time_s.toFixed(1)} s`;
    slider.value = number;
    slider.setAttribute("aria-valuetext", words);
    output.textContent = words;
    if (rows) {
      const none = cells(["no objects", ...columns.slice(1).map(() => "")]);
      rows.replaceChildren(...(frame.objects.length ? frame.objects.map(cells) : [none]));
    }
    document.dispatchEvent(new CustomEvent("frame", { detail: frame.frame }));
  }

  function stop() {
    clearTimeout(timer);
    timer = null;
    play.textContent = "Play";
    play.setAttribute("aria-pressed", "false");
  }

  function advance() {
    if (current === frames.length - 1) return stop();
    const step = frames[current + 1].time_s - frames[current].time_s;
    const seconds = step > 0 && step < 5 ? step : 1 / rateHz;
    timer = setTimeout(() => { show(current + 1); advance(); }, 1000 * seconds / Number(speed.value));
  }

  function toggle() {
    if (timer !== null) return stop();
    if (current === frames.length - 1) show(0);
    play.textContent = "Pause";
    play.setAttribute("aria-pressed", "true");
    advance();
  }

  const keys = {
    ArrowLeft: (step) => show(current - step), ArrowRight: (step) => show(current + step),
    Home: () => show(0), End: () => show(frames.length - 1), " ": toggle,
  };

  function onKey(event) {
    const target = event.target, action = keys[event.key];
    if (!action || event.ctrlKey || event.altKey || event.metaKey) return;
    const box = player.getBoundingClientRect();
    const isHere = player.contains(target);
    const isFree = target === document.body && box.bottom > 0 && box.top < innerHeight;
    // Elements with keys of their own keep them.
    const isOwn = target.matches("select, .scroll, .objects") || (event.key === " " && target.matches("button"));
    if ((!isHere && !isFree) || isOwn) return;
    event.preventDefault();
    if (event.key !== " ") stop();
    action(event.shiftKey ? 10 : 1);
  }

  slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
  play.addEventListener("click", toggle);
  find("[data-step='-1']").addEventListener("click", () => { stop(); show(current - 1); });
  find("[data-step='1']").addEventListener("click", () => { stop(); show(current + 1); });
  document.addEventListener("keydown", onKey);
  document.addEventListener("seek", (event) => {
    const distance = (frame) => Math.abs(frame.frame - event.detail);
    stop();
    show(frames.reduce((best, frame, number) => (distance(frame) < distance(frames[best]) ? number : best), 0));
    player.scrollIntoView({ block: "nearest" });
  });
  show(0);
})();
