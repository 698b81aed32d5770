"use strict";
const all = (selector, from = document) => [...from.querySelectorAll(selector)];

// What the page carries packed: gzip in base64.
const unpacked = async (text, type) => {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Blob([await new Response(stream).arrayBuffer()], { type });
};
all("img[data-packed]").forEach(async (image) => {
  image.src = URL.createObjectURL(await unpacked(image.dataset.packed, "image/svg+xml"));
});

// Figures: a click makes one as large as the window; Esc makes it small again.
const small = () => all("figure.large").forEach((figure) => figure.classList.remove("large"));
addEventListener("keydown", (event) => { if (event.key === "Escape") small(); });
all("figure > a").forEach((link) => link.addEventListener("click", (event) => {
  event.preventDefault();
  const large = link.parentElement.classList.contains("large");
  small();
  link.parentElement.classList.toggle("large", !large);
}));

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
document.querySelector("nav details").open = innerWidth > 900;

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

// Rows: those that fit the filters of the page and the words above their table.
const filters = document.querySelector(".filters");
const fits = (row, chosen, words) => {
  for (const key of ["scene", "model"]) {
    const wanted = chosen.get(key);
    if (wanted && row.dataset[key] && row.dataset[key] !== wanted) return false;
  }
  if (chosen.get("differences") && !("outside" in row.dataset)) return false;
  return row.textContent.toLowerCase().includes(words);
};
const filter = () => {
  const chosen = new FormData(filters);
  for (const item of all(".item")) {
    const words = (item.querySelector(".find")?.value ?? "").trim().toLowerCase();
    const rows = all("tbody tr", item);
    for (const row of rows) row.hidden = !fits(row, chosen, words);
    item.classList.toggle("empty", rows.length > 0 && rows.every((row) => row.hidden));
  }
};
filters.addEventListener("input", filter);
filters.addEventListener("submit", (event) => event.preventDefault());
all(".find").forEach((input) => input.addEventListener("input", filter));

// Charts: a figure can be explored; the library that draws is unpacked when the first is opened.
let library;
const loaded = () => library ??= new Promise(async (resolve) => {
  const script = document.createElement("script");
  const packed = document.getElementById("charts").textContent;
  script.src = URL.createObjectURL(await unpacked(packed, "text/javascript"));
  script.onload = resolve;
  document.head.append(script);
});
for (const part of all("details.chart")) {
  part.addEventListener("toggle", async () => {
    const spec = part.querySelector("script");
    if (!part.open || !spec) return;
    const place = document.createElement("div");
    spec.replaceWith(place);
    const blob = await unpacked(spec.textContent, "application/json");
    await loaded();
    vegaEmbed(place, JSON.parse(await blob.text()), { actions: false, renderer: "svg" });
  });
}
