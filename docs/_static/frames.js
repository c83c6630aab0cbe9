// Frames with pages of the viewer are as tall as their content.
addEventListener("message", ({ source, data }) => {
  for (const frame of document.querySelectorAll("iframe.viewer")) {
    if (frame.contentWindow === source && data?.geodesicOcpHeight) {
      frame.style.height = `${Number(data.geodesicOcpHeight)}px`;
    }
  }
});
