"use strict";
const all = (selector, from = document) => [...from.querySelectorAll(selector)];

// Links: one opens the folded part that it leads to.
const open = () => {
  const target = location.hash && document.getElementById(location.hash.slice(1));
  if (!target) return;
  for (let e = target; e; e = e.parentElement) if (e.matches("details")) e.open = true;
  all(":scope > details", target).forEach((part) => { part.open = true; });
  target.scrollIntoView();
};
addEventListener("hashchange", open);
addEventListener("load", open);
addEventListener("beforeprint", () => all("details").forEach((part) => { part.open = true; }));

// Tables: one that is wider than its place says so.
const hint = () => all(".scroll").forEach((place) => {
  const note = place.previousElementSibling;
  if (place.clientWidth) note.hidden = place.scrollWidth <= place.clientWidth;
});
addEventListener("resize", hint);
all("details").forEach((part) => part.addEventListener("toggle", hint));
hint();

// Tables: a click on a head sorts, again the other way; numbers by value, units included.
const UNITS = { kB: 1e3, MB: 1e6, GB: 1e9 };
const value = (cell) => {
  const text = cell.textContent.trim().replace("−", "-").replaceAll(",", "");
  const found = text.match(/^[×±+]?(-?[\d.]+(?:e[-+]?\d+)?)\s*([kMG]B)?/i);
  return found ? Number(found[1]) * (UNITS[found[2]] ?? 1) : NaN;
};
const order = (column, down) => (a, b) => {
  const [left, right] = [a.cells[column], b.cells[column]];
  const [x, y] = [value(left), value(right)];
  if (Number.isNaN(x) !== Number.isNaN(y)) return Number.isNaN(x) ? 1 : -1; // words last
  const by = Number.isNaN(x) ? left.textContent.localeCompare(right.textContent) : x - y;
  return down ? -by : by;
};
all("th > button").forEach((button) => button.addEventListener("click", () => {
  const head = button.parentElement;
  const down = head.getAttribute("aria-sort") === "ascending";
  all("th", head.parentElement).forEach((other) => other.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", down ? "descending" : "ascending");
  const body = head.closest("table").tBodies[0];
  body.append(...[...body.rows].sort(order(head.cellIndex, down)));
}));
