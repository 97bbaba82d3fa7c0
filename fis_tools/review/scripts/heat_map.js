// An output over two inputs as a heat map with contours and a colour bar.

const MAP_MARGIN = { left: 58, right: 92, top: 14, bottom: 44 };

function paintCells(context, response, scale, frame) {
  const { values, low, high } = response;
  const [rows, columns] = [values.length, values[0].length];
  const image = new ImageData(columns, rows);
  const part = linear(low, high, 0, 1);
  values.forEach((row, i) =>
    row.forEach((value, j) => image.data.set([...scale(part(value)), 255], 4 * ((rows - 1 - i) * columns + j))),
  );
  const small = make("canvas", { width: columns, height: rows });
  small.getContext("2d").putImageData(image, 0, 0);
  context.save();
  context.beginPath();
  context.rect(frame.left, frame.top, frame.width, frame.height);
  context.clip();
  const [dx, dy] = [frame.width / (columns - 1), frame.height / (rows - 1)];
  context.drawImage(small, frame.left - dx / 2, frame.top - dy / 2, frame.width + dx, frame.height + dy);
  context.restore();
}

function strokeContour(context, response, level, frame) {
  const { values } = response;
  const [rows, columns] = [values.length - 1, values[0].length - 1];
  const x = linear(0, columns, frame.left, frame.left + frame.width);
  const y = linear(0, rows, frame.top + frame.height, frame.top);
  context.beginPath();
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      for (const [x1, y1, x2, y2] of contourInCell(cornersOf(values, row, column), level)) {
        context.moveTo(x(column + x1), y(row + y1));
        context.lineTo(x(column + x2), y(row + y2));
      }
    }
  }
  context.stroke();
}

/** Lines of equal height that read on dark and on bright ground; zero is drawn thicker. */
function paintContours(context, response, frame) {
  const part = linear(response.low, response.high, 0, 1);
  for (const level of ticks(response.low, response.high, 9)) {
    context.strokeStyle = part(level) < 0.5 ? "rgba(255,255,255,.75)" : "rgba(0,0,0,.6)";
    context.lineWidth = level === 0 ? 2.4 : 0.9;
    strokeContour(context, response, level, frame);
  }
}

function paintMapAxes(context, response, frame, colours) {
  const { xVariable, yVariable } = response;
  const x = linear(xVariable.minimum, xVariable.maximum, frame.left, frame.left + frame.width);
  const y = linear(yVariable.minimum, yVariable.maximum, frame.top + frame.height, frame.top);
  const bottom = frame.top + frame.height;
  context.strokeStyle = colours.muted;
  context.lineWidth = 1;
  context.strokeRect(frame.left, frame.top, frame.width, frame.height);
  context.fillStyle = colours.muted;
  context.textAlign = "center";
  for (const value of ticks(xVariable.minimum, xVariable.maximum, 5)) {
    context.fillRect(x(value), bottom, 1, 4);
    context.fillText(shown(value), x(value), bottom + 16);
  }
  context.textAlign = "right";
  for (const value of ticks(yVariable.minimum, yVariable.maximum, 5)) {
    context.fillRect(frame.left - 4, y(value), 4, 1);
    context.fillText(shown(value), frame.left - 7, y(value) + 4);
  }
  context.fillStyle = colours.ink;
  context.textAlign = "center";
  context.fillText(withUnit(xVariable), frame.left + frame.width / 2, bottom + 34);
  turnedText(context, withUnit(yVariable), 13, frame.top + frame.height / 2);
  return { x, y };
}

function turnedText(context, text, x, y) {
  context.save();
  context.translate(x, y);
  context.rotate(-Math.PI / 2);
  context.textAlign = "center";
  context.fillText(text, 0, 0);
  context.restore();
}

function paintColourBar(context, response, scale, frame, colours) {
  const left = frame.left + frame.width + 16;
  const value = linear(frame.top + frame.height, frame.top, 0, 1);
  for (let y = frame.top; y < frame.top + frame.height; y++) {
    context.fillStyle = rgb(scale(value(y)));
    context.fillRect(left, y, 12, 1.5);
  }
  const y = linear(response.low, response.high, frame.top + frame.height, frame.top);
  context.fillStyle = colours.muted;
  context.textAlign = "left";
  for (const level of ticks(response.low, response.high, 6)) {
    const place = response.high > response.low ? y(level) : frame.top + frame.height / 2;
    context.fillRect(left + 12, place, 4, 1);
    context.fillText(shown(level, 3), left + 19, place + 4);
  }
  context.fillStyle = colours.ink;
  const right = frame.left + frame.width + MAP_MARGIN.right - 6;
  turnedText(context, withUnit(response.variable), right, frame.top + frame.height / 2);
}

/** Mark the present inputs: a ring that reads on every ground. */
function paintMark(context, x, y, colours) {
  for (const [colour, width] of [["#000000", 4.5], ["#ffffff", 3], [colours.mark, 1.6]]) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.beginPath();
    context.arc(x, y, 6, 0, 2 * Math.PI);
    context.stroke();
  }
}

function mapFrame({ clientWidth, clientHeight }) {
  const { left, right, top, bottom } = MAP_MARGIN;
  return { left, top, width: clientWidth - left - right, height: clientHeight - top - bottom };
}

/** Where a pointer is on a map, in fractions of what is shown along x and y. */
function placeOnMap(canvas, { offsetX, offsetY }) {
  const { left, top, width, height } = mapFrame(canvas);
  return [(offsetX - left) / width, 1 - (offsetY - top) / height];
}

/** The values along x and y under a pointer; null beside the map. */
function pointOnMap(canvas, { xVariable, yVariable }, event) {
  const place = placeOnMap(canvas, event);
  if (place.some((part) => part < 0 || part > 1)) return null;
  return [xVariable, yVariable].map(({ minimum, maximum }, axis) => minimum + place[axis] * (maximum - minimum));
}

/** Draw the heat map of a response; `point` holds the present values along x and y. */
function paintHeatMap(canvas, response, scale, point) {
  const { context } = sharpContext(canvas);
  const colours = themeColours();
  const frame = mapFrame(canvas);
  paintCells(context, response, scale, frame);
  paintContours(context, response, frame);
  const { x, y } = paintMapAxes(context, response, frame, colours);
  paintColourBar(context, response, scale, frame, colours);
  context.beginPath();
  context.rect(frame.left - 7, frame.top - 7, frame.width + 14, frame.height + 14);
  context.clip();
  paintMark(context, x(point[0]), y(point[1]), colours);
}
