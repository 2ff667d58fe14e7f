"""What a test sees on the page: grey levels, sizes, files."""

import struct
import zlib

# Red parts of a canvas, left to right and top to bottom: grey levels of the grey colour map.
LEVELS = """canvas => {
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return Array.from({ length: pixels.length / 4 }, (_, at) => pixels[4 * at]);
}"""


def levels(page, name):
    return page.locator(f"#{name}").evaluate(LEVELS)


def seen(page, name, side):
    """Waits for an image of light and dark."""
    page.wait_for_function(
        f"() => {{ const levels = ({LEVELS})(document.getElementById('{name}'));"
        f" return levels.length === {side * side} && Math.max(...levels) > 200 && Math.min(...levels) < 30; }}"
    )


def looks_like(page, name, wanted, least=0.85):
    """Waits until an image correlates with `wanted`, a list of as many levels."""
    page.wait_for_function(
        f"""([wanted, least]) => {{
          const got = ({LEVELS})(document.getElementById('{name}'));
          const mean = list => list.reduce((a, b) => a + b, 0) / list.length;
          const [a, b] = [mean(got), mean(wanted)], sum = of => got.reduce((all, _, at) => all + of(got[at] - a, wanted[at] - b), 0);
          return sum((x, y) => x * y) / Math.sqrt(sum(x => x * x) * sum((_, y) => y * y)) > least;
        }}""",
        arg=[wanted, least],
    )


def fits(page):
    """Nothing sticks out of the screen sideways."""
    width, screen = page.evaluate("[document.documentElement.scrollWidth, window.innerWidth]")
    assert width <= screen, f"{width} px of page on {screen} px of screen"


def numbers(path):
    """A square .npy file of float32: its side and its values."""
    data = open(path, "rb").read()
    assert data[:8] == b"\x93NUMPY\x01\x00" and len(data[: 10 + data[8] + 256 * data[9]]) == 128, data[:16]
    values = struct.unpack(f"<{(len(data) - 128) // 4}f", data[128:])
    side = round(len(values) ** 0.5)
    assert f"'shape': ({side}, {side})".encode() in data and side * side == len(values)
    return side, values


def rows(page, name):
    """The rows of a list of facts: name, value, and how the value is marked."""
    return page.locator(f"#{name}").evaluate("""list => Array.from({ length: list.children.length / 2 }, (_, at) =>
      [list.children[2 * at].textContent, list.children[2 * at + 1].textContent, list.children[2 * at + 1].className])""")


def png(width, level, height=None):
    """A grey PNG whose pixels are `level(x, y)`, 0 to 255; as high as wide without a height."""
    height = height or width
    lines = b"".join(b"\0" + bytes(level(x, y) for x in range(width)) for y in range(height))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b"")
