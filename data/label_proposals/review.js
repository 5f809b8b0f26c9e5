"use strict";
const data = JSON.parse(document.getElementById("objects").textContent);
const key = "trifuse review " + data.drive;
let decisions = {};
try { decisions = JSON.parse(localStorage.getItem(key)) || {}; } catch (error) { decisions = {}; }
const list = document.getElementById("list");
const count = document.getElementById("count");

function remember() {
  for (const [number, one] of Object.entries(decisions)) {
    if (!one.decision && !one.type) delete decisions[number];
  }
  const done = Object.values(decisions).filter((one) => one.decision).length;
  count.textContent = done + " of " + data.objects.length + " decided";
  try { localStorage.setItem(key, JSON.stringify(decisions)); } catch (error) { /* a page without storage */ }
}

function card(one) {
  const box = document.createElement("article");
  const image = new Image();
  image.src = "data:image/jpeg;base64," + one.image;
  image.alt = "object " + one.number + " from above";
  const text = document.createElement("p");
  text.textContent = "#" + one.number + "  " + one.confidence + "  " + one.facts;
  const reasons = document.createElement("p");
  reasons.className = "reasons";
  reasons.textContent = one.reasons.join("; ");
  const kind = document.createElement("select");
  for (const name of data.classes) kind.add(new Option(name, name, name === one.type, name === one.type));
  const buttons = ["accept", "reject"].map((name) => {
    const button = document.createElement("button");
    button.textContent = name;
    button.onclick = () => decide(name);
    return button;
  });
  function show() {
    const mine = decisions[one.number] || {};
    box.className = mine.decision || "";
    kind.value = mine.type || one.type;
  }
  function decide(name) {
    const mine = decisions[one.number] || (decisions[one.number] = {});
    mine.decision = mine.decision === name ? "" : name;
    remember();
    show();
  }
  kind.onchange = () => {
    const mine = decisions[one.number] || (decisions[one.number] = {});
    mine.type = kind.value === one.type ? "" : kind.value;
    remember();
    show();
  };
  box.append(image, text, reasons, kind, ...buttons);
  show();
  return box;
}

list.append(...data.objects.map(card));
remember();
document.getElementById("save").onclick = () => {
  const text = JSON.stringify({ format: data.format, drive: data.drive, objects: decisions }, null, 1);
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "application/json" }));
  link.download = "review.json";
  link.click();
};
