// Chooses frames, enlarges their pictures, sorts the tables: without it all are there.
const all = (selector, from = document) => [...from.querySelectorAll(selector)];
const root = document.documentElement;
const chooser = document.querySelector(".chooser");
const labels = all("[data-toggle]").map((button) => button.dataset.toggle);
const state = {
  figure: chooser?.dataset.first || document.querySelector(".figure:has(.shot)")?.id,
  algorithms: new Set(labels.slice(0, Number(chooser?.dataset.shown))),
  rank: "worst",
};
root.classList.add("js");

const figures = all(".figure");
const slider = document.getElementById("slider");
const selects = all("[data-select]");
const isPressed = (button) => button?.getAttribute("aria-pressed") === "true";
const chosen = (name) => selects.find((select) => select.dataset.select === name)?.value;

// True for a shot of an algorithm and a run that are chosen.
function isChosen({ dataset: { algorithm, run } }) {
  return (labels.length === 0 || state.algorithms.has(algorithm)) && (!chosen("run") || run === chosen("run"));
}

// The figures that the filters leave.
function shown() {
  const shots = state.filter ? `.shot[data-is~="${state.filter}"]` : ".shot";
  const checkpoint = chosen("checkpoint");
  const isUnseen = (figure) => !state.filter && !chosen("run") && !figure.querySelector(".shot");
  return figures.filter(
    (figure) =>
      (!checkpoint || figure.dataset.checkpoint?.split(" ").includes(checkpoint)) &&
      (isUnseen(figure) || all(shots, figure).some(isChosen)),
  );
}

// Fills a line that shows a command; `words`: those before it.
function tell(line, command, words) {
  if (!line) return;
  line.hidden = !command && !words;
  line.querySelector("code").textContent = command ?? "";
  line.querySelector(".copy").hidden = !command;
  if (words) line.querySelector("span").textContent = words;
}

function show() {
  const list = shown();
  if (list.length > 0 && !list.some((figure) => figure.id === state.figure)) state.figure = list[0].id;
  for (const figure of figures) figure.classList.toggle("on", list.includes(figure) && figure.id === state.figure);
  for (const shot of all(".shot")) {
    const { rank } = shot.dataset;
    shot.classList.toggle("off", !isChosen(shot) || Boolean(rank && rank !== state.rank));
  }
  const seen = all(".figure.on .shot:not(.off)[data-replay]");
  const { replay } = seen[0]?.dataset ?? {};
  const same = seen.filter((shot) => shot.dataset.replay === replay);
  const algorithms = new Set(same.map((shot) => shot.dataset.algo));
  tell(document.getElementById("frame-command"), replay && [replay, ...algorithms].join(" "));
  const press = (name, isOn) => {
    for (const button of all(`[data-${name}]`, chooser))
      button.setAttribute("aria-pressed", isOn(button.dataset[name]));
  };
  press("choose", (id) => id === state.figure);
  press("toggle", (label) => state.algorithms.has(label));
  press("rank", (rank) => rank === state.rank);
  press("filter", (filter) => filter === state.filter);
  for (const button of all("[data-filter][data-algorithm]"))
    button.setAttribute("aria-pressed", button.dataset.filter === state.filter && isChosen(button));
  for (const button of all("[data-choose]", chooser))
    button.hidden = !list.some((figure) => figure.id === button.dataset.choose);
  if (!slider) return;
  const place = list.findIndex((figure) => figure.id === state.figure);
  slider.max = Math.max(list.length - 1, 0);
  slider.value = place;
  slider.nextElementSibling.nextElementSibling.textContent = list.length ? `${place + 1} of ${list.length}` : "none";
}

// The fragment of a figure: of a frame its run and number, and the algorithm if only one is shown.
function address() {
  const frame = document.getElementById(state.figure)?.dataset.frame;
  const chosen = [...state.algorithms];
  const parts = frame && chosen.length === 1 ? [frame, chosen[0]] : [frame ?? state.figure];
  return "#" + parts.map(encodeURI).join("/");
}

function choose(id) {
  state.figure = id;
  show();
  history.replaceState(null, "", address());
}

function step(by) {
  const list = shown();
  const place = list.findIndex((figure) => figure.id === state.figure);
  const next = list[Math.min(Math.max(place + by, 0), list.length - 1)];
  if (next) choose(next.id);
}

// Shows the truth in the place of each estimate, or the estimates again.
function blink(isOn) {
  for (const own of all(".blink")) own.remove();
  if (!isOn) return;
  const figure = document.getElementById(state.figure) ?? document;
  for (const place of all('.shot:not(.off) [data-kind="estimate"]', figure)) {
    const from = place.closest(".shot").querySelector('[data-kind="truth"] svg');
    const truth = (from ?? figure.querySelector('.truth [data-kind="truth"] svg'))?.cloneNode(true);
    truth?.classList.add("blink");
    if (truth) place.append(truth);
  }
}

function enlarge(svg) {
  const dialog = document.createElement("dialog");
  dialog.append(svg.cloneNode(true));
  dialog.addEventListener("close", () => dialog.remove());
  dialog.addEventListener("click", () => dialog.close());
  document.body.append(dialog);
  dialog.showModal();
}

// The first number of a cell.
function value(cell) {
  const text = cell?.dataset.value ?? cell?.textContent ?? "";
  return Number(text.match(/-?\d[\d.]*(e-?\d+)?/)?.[0] ?? NaN);
}

// Sorts a table by a column: numbers as numbers, and cells without one last; names as texts.
function sort(head) {
  const body = head.closest("table").tBodies[0], rows = [...body.rows], column = head.cellIndex;
  const isText = column === 0 || head.matches(".text") && !rows.some((row) => row.cells[column].dataset.value);
  const order = head.getAttribute("aria-sort"), { first } = head.firstElementChild.dataset;
  // The best first, at the second click the worst.
  const isDown = order ? order === "ascending" : first !== "ascending" && !isText;
  for (const other of all("th", head.parentNode)) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", isDown ? "descending" : "ascending");
  const words = (row) => row.cells[column].textContent;
  const compare = (a, b) => isText
    ? words(b).localeCompare(words(a), "en", { numeric: true })
    : value(b.cells[column]) - value(a.cells[column]);
  const isNone = (row) => !isText && Number.isNaN(value(row.cells[column]));
  const sorted = rows.filter((row) => !isNone(row));
  sorted.sort((a, b) => (isDown ? compare(a, b) : compare(b, a)));
  body.append(...sorted, ...rows.filter(isNone));
  if (head.closest("#headline")) document.getElementById("order")?.remove();
}

// Every heading of a column is a button.
for (const head of all("thead th[scope=col]:not(:has(button, .cp))")) {
  if (head.closest(".heat")) continue;
  const button = document.createElement("button");
  button.append(...head.childNodes);
  head.append(button);
}

// Shows the drives of the chosen algorithms: their ways on the maps, and their rows.
function layer() {
  const shown = all("[data-show][aria-pressed=true]").map((button) => button.dataset.show);
  for (const own of all("[data-layer]")) own.style.display = shown.includes(own.dataset.layer) ? "" : "none";
  for (const row of all("#courses tbody tr")) row.hidden = !shown.includes(row.cells[1].textContent);
}
const layers = all("[data-show]");
if (layers.length > 3) layers.slice(2).forEach((button) => button.setAttribute("aria-pressed", false));
if (layers.length) layer();

// Contents are for long pages.
const contents = document.querySelector(".contents");
if (contents) contents.hidden = root.scrollHeight < 3 * innerHeight;

// Opens what a fragment names: the frame of a square, a figure or a folded part.
function go(fragment, algorithm) {
  const name = decodeURI(fragment.slice(1));
  const isFrame = ({ dataset: { frame } }) => frame && (name === frame || name.startsWith(`${frame}/`));
  const isNamed = (figure) => all(".shot", figure).some((shot) => name.endsWith(`/${shot.dataset.algorithm}`));
  const frame = figures.find((figure) => isFrame(figure) && isNamed(figure)) ?? figures.find(isFrame);
  const target = frame ?? document.getElementById(name);
  const own = algorithm ?? (frame && name.slice(frame.dataset.frame.length + 1));
  if (labels.includes(own)) state.algorithms = new Set([own]);
  const square = all("a.cp").find((a) => a.hash === fragment);
  if (square) {
    const { figure, algorithm } = square.dataset;
    Object.assign(state, { figure, algorithms: new Set([algorithm]), rank: "worst" });
  } else if (target?.matches(".figure")) state.figure = target.id;
  target?.closest("details")?.setAttribute("open", "");
  const isOpened = square || target?.matches(".figure");
  const isHidden = () => isOpened && !shown().some((figure) => figure.id === state.figure);
  if (isHidden()) {
    state.filter = "";
    for (const select of selects) select.value = "";
    const shot = document.getElementById(state.figure).querySelector(".shot");
    if (isHidden() && shot) state.algorithms.add(shot.dataset.algorithm);
  }
  if (chooser) show();
  (isOpened ? document.getElementById("frames") : target)?.scrollIntoView();
}

document.addEventListener("click", (event) => {
  const svg = event.target.closest(".pictures svg");
  if (svg) return enlarge(svg);
  const button = event.target.closest("button, a");
  if (!button) return;
  const { choose: id, toggle, rank, show: drive, figure, algorithm, filter, step: by } = button.dataset;
  if (button.matches(".bin")) {
    tell(document.getElementById("bin"), button.dataset.command, button.title);
    if (button.hash === "#bin") return event.preventDefault();
  }
  if (id) choose(id);
  else if (by) step(Number(by));
  else if (filter) {
    state.filter = isPressed(button) ? "" : filter;
    if (algorithm) go("#frames", algorithm);
  }
  else if (button.matches(".copy")) navigator.clipboard?.writeText(button.previousElementSibling.textContent);
  else if (toggle) state.algorithms[state.algorithms.has(toggle) ? "delete" : "add"](toggle);
  else if (drive) {
    button.setAttribute("aria-pressed", !isPressed(button));
    layer();
  } else if (rank) state.rank = rank;
  else if (figure) {
    history.replaceState(null, "", button.hash);
    go(button.hash);
    event.preventDefault();
  } else if (button.id === "all") {
    document.getElementById("headline").classList.remove("long");
    button.parentNode.remove();
  } else if (button.closest("thead")) sort(button.closest("th"));
  else if (button.hash) {
    go(button.hash, algorithm);
    event.preventDefault();
    history.replaceState(null, "", button.hash);
  }
  if (chooser) show();
});
for (const select of selects) select.addEventListener("change", show);
slider?.addEventListener("input", () => {
  const figure = shown()[slider.value];
  if (figure) choose(figure.id);
});
document.addEventListener("keydown", (event) => {
  if (event.target.closest?.("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "t" && !event.repeat) blink(true);
  const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (chooser && by && !document.querySelector("dialog")) step(by);
});
document.addEventListener("keyup", (event) => event.key === "t" && blink(false));
window.addEventListener("hashchange", () => go(location.hash));
go(location.hash);
