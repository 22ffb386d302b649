"use strict";

// the picture follows the slider; dragging on the picture moves the slider
for (const compare of document.querySelectorAll(".compare")) {
  const stack = compare.querySelector(".stack");
  const range = compare.querySelector("input[type=range]");
  const show = () => {
    stack.style.setProperty("--split", range.value + "%");
    range.setAttribute("aria-valuetext", range.value + " % of the picture with water");
  };
  const follow = (event) => {
    const box = stack.getBoundingClientRect();
    range.value = Math.round((100 * (event.clientX - box.left)) / box.width);
    show();
  };
  range.addEventListener("input", show);
  stack.addEventListener("pointerdown", (event) => {
    event.preventDefault();
    stack.setPointerCapture(event.pointerId);
    follow(event);
  });
  stack.addEventListener("pointermove", (event) => {
    if (event.buttons) follow(event);
  });
  show();
}

// a click on a head sorts by that column, a second one the other way; cells without a number stay last
const key = (row, column) => {
  const cell = row.cells[column];
  return "value" in cell.dataset ? (cell.dataset.value === "" ? null : Number(cell.dataset.value)) : cell.textContent;
};
const compareKeys = (a, b, sign) => {
  if (a === null || b === null) return (a === null) - (b === null);
  return sign * (typeof a === "number" ? a - b : a.localeCompare(b, "en", { numeric: true }));
};
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    head.querySelector("button").addEventListener("click", () => {
      const direction = head.getAttribute("aria-sort") === "ascending" ? "descending" : "ascending";
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", direction);
      const sign = direction === "ascending" ? 1 : -1;
      const body = table.tBodies[0];
      const rows = [...body.rows].map((row) => [key(row, column), row]);
      rows.sort((a, b) => compareKeys(a[0], b[0], sign));
      body.append(...rows.map((pair) => pair[1]));
    });
  });
}
