// A button that copies a block: of a dialogue with "$ " only what is typed.
addEventListener("DOMContentLoaded", () => {
  for (const block of document.querySelectorAll("article .highlight")) {
    const button = document.createElement("button");
    button.className = "copy";
    button.textContent = "Copy";
    button.onclick = () => {
      const text = block.querySelector("pre").textContent;
      const typed = text.split("\n").filter((line) => line.startsWith("$ ")).map((line) => line.slice(2));
      navigator.clipboard.writeText(typed.length ? typed.join("\n") : text);
      button.textContent = "Copied";
    };
    block.append(button);
  }
});
