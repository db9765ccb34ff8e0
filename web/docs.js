// The documentation of the API, made from openapi.json of this very daemon; works without the internet.
// The rule: everything is put into the page as text.

const MARKDOWN_CODE = /`([^`]+)`/;

function element(tag, className, text) {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

// Paragraphs, tables and `code` of Markdown, which is all that our descriptions use.
function prose(text) {
  const made = element("div");
  for (const block of text.split(/\n\s*\n/)) {
    if (block.startsWith("|")) made.append(table(block));
    else if (block.startsWith("## ")) made.append(inline(element("h2"), block.slice(3)));
    else made.append(inline(element("p"), block));
  }
  return made;
}

function table(block) {
  const made = element("table");
  block.split("\n").filter((line) => !/^\|[\s|-]+$/.test(line)).forEach((line, index) => {
    const row = element("tr");
    for (const cell of line.slice(1, -1).split(/ \| /)) row.append(inline(element(index ? "td" : "th"), cell.trim()));
    made.append(row);
  });
  return made;
}

function inline(parent, text) {
  text.split(MARKDOWN_CODE).forEach((part, index) => parent.append(index % 2 ? element("code", "", part) : part));
  return parent;
}

function example(title, value) {
  const made = element("div");
  made.append(element("p", "figures", title), element("pre", "", typeof value === "string" ? value : JSON.stringify(value, null, 2)));
  return made;
}

function operation(method, path, described) {
  const made = element("details");
  made.id = described.operationId;
  const head = element("summary");
  head.append(element("span", "method", method.toUpperCase()), element("code", "", path), ` ${described.summary}`);
  made.append(head, prose(described.description));
  for (const parameter of described.parameters ?? []) {
    const need = parameter.required ? "required" : "optional";
    made.append(inline(element("p"), `\`${parameter.name}\` in ${parameter.in}, ${need}. ${parameter.description ?? ""}`));
  }
  for (const [type, media] of Object.entries(described.requestBody?.content ?? {})) made.append(example(`Body, ${type}`, media.example));
  for (const [status, answer] of Object.entries(described.responses)) {
    const media = Object.entries(answer.content ?? {});
    if (status < 400) {
      if (media.length === 0) made.append(element("p", "figures", `${status}: no content`));
      for (const [type, content] of media) made.append(example(`${status}, ${type}`, content.example));
    } else {
      made.append(inline(element("p"), `${status}: ${answer.description}`));
    }
  }
  return made;
}

function problems(paths) {
  const titles = new Map();
  for (const item of Object.values(paths)) {
    for (const described of Object.values(item)) {
      for (const answer of Object.values(described.responses)) {
        const examples = answer.content?.["application/problem+json"]?.examples ?? {};
        for (const [code, one] of Object.entries(examples)) titles.set(code, one.value);
      }
    }
  }
  const made = element("section");
  made.append(element("h2", "", "Problems"));
  for (const [code, problem] of [...titles].sort()) {
    const line = inline(element("p"), `\`${code}\` (${problem.status}): ${problem.title}`);
    line.id = `problem-${code}`;
    made.append(line);
  }
  return made;
}

async function main() {
  const response = await fetch("/api/v1/openapi.json");
  const api = await response.json();
  const sections = new Map();
  for (const [path, item] of Object.entries(api.paths)) {
    for (const [method, described] of Object.entries(item)) {
      const tag = described.tags[0];
      if (!sections.has(tag)) sections.set(tag, element("section"));
      sections.get(tag).append(operation(method, path, described));
    }
  }
  const page = document.getElementById("docs");
  page.replaceChildren(prose(api.info.description));
  for (const [tag, section] of sections) {
    section.prepend(element("h2", "", tag));
    page.append(section);
  }
  page.append(problems(api.paths));
  if (location.hash) document.getElementById(location.hash.slice(1))?.scrollIntoView();
}

main().catch((error) => {
  document.getElementById("docs").replaceChildren(element("p", "alarm-text", `The description could not be loaded: ${error.message}`));
});
