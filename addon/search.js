// The search of the manual's pages. `INDEX` is in the page's search_index.js: [page, anchor, heading, text] of each section.

// Returns the sections that have all words of a query, those with the words in their heading first.
function find(index, query, most = 20) {
  const words = query.toLowerCase().split(/\s+/).filter((word) => word);
  if (!words.length) return [];
  const found = [];
  index.forEach(([page, anchor, heading, text], place) => {
    const title = heading.toLowerCase(), all = `${title} ${text.toLowerCase()}`;
    if (!words.every((word) => all.includes(word))) return;
    const score = words.filter((word) => title.includes(word)).length;
    found.push({ page, anchor, heading, score, place, words: around(text, words[0]) });
  });
  return found.sort((a, b) => b.score - a.score || a.place - b.place).slice(0, most);
}

// Returns some words of a text, around the first place that has one.
function around(text, word, before = 40, length = 140) {
  const first = Math.max(0, text.toLowerCase().indexOf(word) - before);
  const begin = first && text.indexOf(" ", first) + 1;
  return (begin ? "… " : "") + text.slice(begin, begin + length) + (begin + length < text.length ? " …" : "");
}

function show(box, list) {
  list.replaceChildren(...find(INDEX, box.value).map(({ page, anchor, heading, words }) => {
    const row = document.createElement("li"), link = document.createElement("a"), text = document.createElement("span");
    link.href = `${page}#${anchor}`;
    link.textContent = heading;
    text.textContent = ` ${words}`;
    row.append(link, text);
    return row;
  }));
}

if (typeof document === "undefined") module.exports = { find };
else {
  const box = document.getElementById("search"), list = document.getElementById("found");
  box.addEventListener("input", () => show(box, list));
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") { box.value = ""; show(box, list); }
    if (event.key === "/" && document.activeElement !== box) { event.preventDefault(); box.focus(); }
  });
}
