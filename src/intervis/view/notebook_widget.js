// The widget of a notebook: the page in an iframe, and its questions for Python.

function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.setAttribute("sandbox", "allow-scripts");
  frame.title = "intervis view";
  frame.style = `width:100%;height:${model.get("height_px")}px;border:0`;
  frame.srcdoc = model.get("page");
  const toPython = (event) => {
    if (event.source === frame.contentWindow && event.data?.intervis) model.send(event.data.intervis);
  };
  const toPage = (answer) => frame.contentWindow?.postMessage({ intervis: answer }, "*");
  addEventListener("message", toPython);
  model.on("msg:custom", toPage);
  el.append(frame);
  return () => {
    removeEventListener("message", toPython);
    model.off("msg:custom", toPage);
  };
}

export default { render };
