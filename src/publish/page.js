// Sorts and filters the table of levels. Without it the page still shows everything.
(() => {
  "use strict";
  const table = document.getElementById("table");
  if (!table) return;
  const body = table.tBodies[0];
  const filter = document.getElementById("filter");
  const state = document.getElementById("state");
  const shown = document.getElementById("shown");
  const order = [...body.rows];
  order.forEach((row, at) => {
    row.dataset.at = at;
    row.words = (row.cells[0].textContent + " " + row.cells[1].textContent).toLowerCase();
  });

  const show = () => {
    const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    for (const row of order) {
      const found = row.dataset.state;
      const fits = state.value === "" || found === "error" || (state.value === "warning" && found === "warning");
      row.hidden = !(fits && words.every((word) => row.words.includes(word)));
      count += row.hidden ? 0 : 1;
    }
    shown.textContent = `${count} of ${order.length} levels`;
  };

  // Numbers by value, text by the reader's alphabet; what has no value goes last in both directions.
  const key = (row, column) => {
    const cell = row.cells[column];
    if (cell.dataset.v === undefined) return cell.textContent;
    return cell.dataset.v === "" ? null : Number(cell.dataset.v);
  };
  const compare = (a, b, sign) => {
    if (a === null || b === null) return (a === null) - (b === null);
    return sign * (typeof a === "number" ? a - b : a.localeCompare(b, undefined, { numeric: true }));
  };
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    head.querySelector("button").addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      for (const other of heads) other.setAttribute("aria-sort", "none");
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      const rows = [...order].sort(
        (a, b) => compare(key(a, column), key(b, column), down ? -1 : 1) || a.dataset.at - b.dataset.at,
      );
      body.append(...rows);
    });
  });
  filter.addEventListener("input", show);
  state.addEventListener("change", show);
  filter.form.addEventListener("submit", (event) => event.preventDefault());
  show();
})();
