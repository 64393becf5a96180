// SPDX-License-Identifier: Apache-2.0
#include "lab/plot.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

namespace palpate::lab {
namespace {

constexpr double figure_width = 860.0;  // [px]
constexpr double margin = 20.0;         // [px] left of the key and right of panels
constexpr double letter = 7.2;          // [px] mean width of one, generously
constexpr double line_height = 20.0;    // [px] of the key and of named rows
constexpr double swatch = 28.0;         // [px] of a series in the key
constexpr double title_height = 24.0;   // [px] above a panel
constexpr double below = 52.0;          // [px] a panel: tics and label

// Okabe and Ito's, less black and yellow: https://jfly.uni-koeln.de/color/
constexpr std::array<std::string_view, 6> palette = {"#0072b2", "#d55e00", "#009e73",
                                                     "#cc79a7", "#e69f00", "#56b4e9"};
// How a path draws each Mark, and each Line; the last is of steps in colours that come again.
constexpr std::array<std::string_view, 9> shapes = {"",
                                                    "h0",
                                                    "m-4-4h8v8h-8z",
                                                    "m0-5l4.6 8h-9.2z",
                                                    "m0-5.4l5.4 5.4l-5.4 5.4l-5.4-5.4z",
                                                    "m-4.5 0a4.5 4.5 0 1 0 9 0a4.5 4.5 0 1 0-9 0",
                                                    "m-4-4l8 8m0-8l-8 8",
                                                    "m-5 0h10m-5-5v10",
                                                    "h0"};
constexpr std::string_view dashed = " stroke-dasharray='7 4'";
constexpr std::array<std::string_view, 6> dashes = {"", "",    dashed, " stroke-dasharray='2 3'",
                                                    "", dashed};

double text_width(std::string_view text) {
  return letter * static_cast<double>(std::count_if(text.begin(), text.end(), [](char c) {
           return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;  // letters, not bytes of UTF-8
         }));
}

// To a tenth of a pixel.
std::string px(double value) {
  return fmt::format("{:g}", std::round(10.0 * value) / 10.0 + 0.0);
}

std::string text_at(double x, double y, std::string_view anchor, std::string_view text,
                    std::string_view more = "") {
  return fmt::format("<text x='{}' y='{}' text-anchor='{}'{}>{}</text>\n", px(x), px(y), anchor,
                     more, escaped(text));
}

// Where the values of an axis are [px], and its tics.
class Scale {
 public:
  // @param coordinate  of the points, 0 or 1: 1 goes upwards, but names go down
  Scale(const Axis& axis, const std::vector<Series>& series, std::size_t coordinate, double length)
      : log_(axis.log), upwards_(coordinate == 1 && axis.names.empty()), length_(length) {
    low_ = anything;
    high_ = -anything;
    for (const Series& one : series) {
      for (const auto& point : one.points) {
        const double value = transformed(point[coordinate]);
        if (!std::isfinite(value)) continue;
        low_ = std::min(low_, value);
        high_ = std::max(high_, value);
      }
    }
    if (low_ > high_) low_ = high_ = 0.0;
    const double beyond = high_ > low_ ? 0.03 * (high_ - low_) : 0.5;
    low_ = std::isnan(axis.low) ? low_ - beyond : transformed(axis.low);
    high_ = std::isnan(axis.high) ? high_ + beyond : transformed(axis.high);
    if (!axis.names.empty()) {
      low_ = 0.5;
      high_ = static_cast<double>(axis.names.size()) + 0.5;
      for (const std::string& name : axis.names)
        tics.emplace_back(static_cast<double>(tics.size() + 1), name);
      return;
    }
    const double gap = (coordinate == 1 ? 36.0 : 50.0) / length_ * (high_ - low_);  // at least
    const double power = std::pow(10.0, std::floor(std::log10(gap)));
    double step = log_ ? std::max(1.0, std::ceil(gap)) : power;
    for (const double factor : {2.0, 5.0, 10.0}) step = step < gap ? factor * power : step;
    for (double n = std::floor(low_ / step); n <= std::ceil(high_ / step); ++n) {
      const double value = log_ ? std::pow(10.0, n * step) : n * step + 0.0;
      const bool large = log_ && std::abs(n * step) > 4.0;
      if (shows(value))
        tics.emplace_back(value,
                          large ? fmt::format("1e{}", n * step) : fmt::format("{:g}", value));
      for (const double between : {2.0 * value, 5.0 * value})  // where there is room
        if (log_ && gap < 0.3 && shows(between))
          tics.emplace_back(between, fmt::format("{:g}", between));
    }
  }

  [[nodiscard]] bool shows(double value) const {
    return transformed(value) >= low_ - 1e-6 && transformed(value) <= high_ + 1e-6;
  }
  [[nodiscard]] double at(double value) const {
    const double share = std::isinf(value) ? (value > 0.0 ? 1.0 : 0.0)
                                           : (transformed(value) - low_) / (high_ - low_);
    return length_ * (upwards_ ? 1.0 - share : share);
  }
  [[nodiscard]] double widest() const {
    double width = 0.0;
    for (const auto& [value, text] : tics) width = std::max(width, text_width(text));
    return width;
  }

  std::vector<std::pair<double, std::string>> tics;

 private:
  [[nodiscard]] double transformed(double value) const {
    if (!log_ || std::isinf(value)) return value;
    return value > 0.0 ? std::log10(value) : fitting;
  }

  bool log_;
  bool upwards_;
  double length_;
  double low_;
  double high_;
};

// Keeps of a curve what the eye can tell: Douglas and Peucker's way.
void simplify(const Points& curve, std::size_t first, std::size_t last, std::vector<bool>& kept) {
  const double x = curve[last][0] - curve[first][0];
  const double y = curve[last][1] - curve[first][1];
  double most = 0.15;  // [px] that the eye cannot tell
  std::size_t farthest = first;
  for (std::size_t i = first + 1; i < last; ++i) {
    const double a = curve[i][0] - curve[first][0];
    const double b = curve[i][1] - curve[first][1];
    const double along = std::clamp((a * x + b * y) / std::max(x * x + y * y, 1e-9), 0.0, 1.0);
    const double off = std::hypot(a - along * x, b - along * y);
    if (off > most) farthest = i;
    most = std::max(most, off);
  }
  if (farthest == first) return;
  kept[farthest] = true;
  simplify(curve, first, farthest, kept);
  simplify(curve, farthest, last, kept);
}

std::string path(const Series& series, int colour, std::string_view stroke,
                 const std::string& data) {
  if (data.empty()) return {};
  return fmt::format(
      "<path fill='none' stroke='{}' stroke-width={} d='{}'><title>{}</title></path>\n",
      colour == grey ? "currentColor' stroke-opacity='.5"
                     : palette[static_cast<std::size_t>(colour) % palette.size()],
      stroke, data, escaped(series.name));
}

// The line through the points [px].
std::string line_of(const Series& series, int colour, const Points& points) {
  std::string data;
  Points curve;
  const auto end = [&] {
    std::vector<bool> kept(curve.size(), false);
    if (!curve.empty()) {
      kept.front() = kept.back() = true;
      simplify(curve, 0, curve.size() - 1, kept);
    }
    for (std::size_t i = 0; i < curve.size(); ++i)
      if (kept[i]) data += (i == 0 ? "M" : "L") + px(curve[i][0]) + " " + px(curve[i][1]);
    curve.clear();
  };
  for (const auto& point : points) {
    const bool finite = std::isfinite(point[0]) && std::isfinite(point[1]);
    if (finite && series.line == Line::steps && !curve.empty())
      curve.push_back({point[0], curve.back()[1]});
    if (finite)
      curve.push_back(point);
    else
      end();
  }
  if (series.line == Line::none) return {};
  end();
  const std::size_t round = colour < static_cast<int>(palette.size()) ? 0 : 1;
  return path(series, colour,
              fmt::format("'1.8' stroke-linejoin='round'{}",
                          dashes[static_cast<std::size_t>(series.line) + round]),
              data);
}

std::string marks_of(const Series& series, int colour, const Points& points) {
  std::string data;
  for (const auto& point : points)
    data += fmt::format("M{} {}{}", px(point[0]), px(point[1]),
                        shapes[static_cast<std::size_t>(series.mark)]);
  if (series.mark == Mark::none) return {};
  return path(series, colour,
              series.mark == Mark::disc  ? "'8' stroke-linecap='round'"
              : series.mark == Mark::dot ? "'3.4' stroke-linecap='round'"
                                         : "'1.6'",
              data);
}

// A panel's frame, tics and series about its upper left corner.
std::string draw(const Panel& panel, const std::map<std::string, int>& colours, double width,
                 double height) {
  const Scale x(panel.x, panel.series, 0, width);
  const Scale y(panel.y, panel.series, 1, height);
  std::string grid;
  std::string drawn = text_at(0.5 * width, -9.0, "middle", panel.title, " font-weight='600'") +
                      text_at(0.5 * width, height + 38.0, "middle", panel.x.label) +
                      text_at(-0.5 * height, -y.widest() - 18.0, "middle", panel.y.label,
                              " transform='rotate(-90)'");
  for (const auto& [value, name] : x.tics) {
    grid += fmt::format("M{} 0v{}", px(x.at(value)), px(height));
    drawn += text_at(x.at(value), height + 17.0, "middle", name);
  }
  for (const auto& [value, name] : y.tics) {
    grid += fmt::format("M0 {}h{}", px(y.at(value)), px(width));
    drawn += text_at(-7.0, y.at(value) + 4.5, "end", name);
  }
  drawn += fmt::format(
      "<path fill='none' stroke='currentColor' stroke-opacity='.14' d='{}'/>\n"
      "<rect width='{}' height='{}' fill='none' stroke='currentColor' stroke-opacity='.4'/>\n",
      grid, px(width), px(height));
  for (const Series& series : panel.series) {
    const int colour = series.colour == by_name ? colours.at(series.name) : series.colour;
    Points all;
    Points shown;
    for (const auto& [a, b] : series.points) {
      all.push_back({x.at(a), y.at(b)});
      if (x.shows(a) && y.shows(b)) shown.push_back(all.back());
    }
    // A line ends at the frame; a mark at the frame is whole.
    drawn += fmt::format("<svg width='{}' height='{}' overflow='hidden'>{}</svg>\n{}", px(width),
                         px(height), line_of(series, colour, all), marks_of(series, colour, shown));
  }
  return drawn;
}

}  // namespace

std::string svg(const Figure& figure, std::string_view title) {
  // The key, a line or more over the panels, and the colours of its names.
  std::map<std::string, int> colours;
  std::string drawn;
  double key = margin;
  double top = 18.0;
  int next = 0;
  for (const Panel& panel : figure.panels) {
    for (const Series& series : panel.series) {
      const int colour = series.colour == by_name ? next : series.colour;
      if (!colours.emplace(series.name, colour).second || series.name.empty()) continue;
      next += series.colour == by_name ? 1 : 0;
      const double needed = swatch + 22.0 + text_width(series.name);
      if (key + needed > figure_width) {
        key = margin;
        top += line_height;
      }
      drawn += line_of(series, colour, {{key, top}, {key + swatch, top}}) +
               marks_of(series, colour, {{key + 0.5 * swatch, top}}) +
               text_at(key + swatch + 6.0, top + 4.5, "start", series.name);
      key += needed;
    }
  }
  if (!drawn.empty()) top += line_height;

  // All panels are as high, and begin as far from the left, as the one that needs most.
  const std::size_t rows = (figure.panels.size() + figure.columns - 1) / figure.columns;
  double height = rows == 1 ? 350.0 : 185.0;
  double left = 0.0;
  double above = 0.0;
  for (const Panel& panel : figure.panels)
    height = std::max(height, line_height * static_cast<double>(panel.y.names.size()));
  for (const Panel& panel : figure.panels) {
    left = std::max(left, Scale(panel.y, panel.series, 1, height).widest() + 22.0 +
                              (panel.y.label.empty() ? 0.0 : margin));
    if (!panel.title.empty()) above = title_height;
  }
  const double across = figure_width / static_cast<double>(figure.columns);
  const double down = above + height + below;
  for (std::size_t i = 0; i < figure.panels.size(); ++i)
    drawn += fmt::format("<g transform='translate({} {})'>\n{}</g>\n",
                         px(left + across * static_cast<double>(i % figure.columns)),
                         px(top + above + down * static_cast<double>(i / figure.columns)),
                         draw(figure.panels[i], colours, across - left - margin, height));
  return fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' class='plot' role='img' width='{0}' height='{1}' "
      "viewBox='0 0 {0} {1}' color='#1c2430' fill='currentColor' "
      "font-family='system-ui,sans-serif' font-size='13'>\n<title>{2}</title>\n"
      "<style>@media (prefers-color-scheme: dark) {{ .plot {{ color: #e6e4de; }} "
      ".plot .paper {{ fill: #16191e; }} }}</style>\n"
      "<rect class='paper' width='100%' height='100%' fill='#fff'/>\n{3}</svg>\n",
      px(figure_width), px(top + down * static_cast<double>(rows)), escaped(title), drawn);
}

std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text)
    result += c == '&'   ? "&amp;"
              : c == '<' ? "&lt;"
              : c == '>' ? "&gt;"
              : c == '"' ? "&quot;"
                         : std::string(1, c);
  return result;
}

Points points(const Table& table, const std::function<bool(std::size_t)>& keep, std::string_view x,
              std::string_view y, Units units) {
  Points result;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (keep(row))
      result.push_back({table.number(row, x) / units[0], table.number(row, y) / units[1]});
  }
  return result;
}

Points points(const Table& table, Where where, std::string_view x, std::string_view y,
              Units units) {
  return points(
      table, [&](std::size_t row) { return table.is(row, where); }, x, y, units);
}

void add_methods(Panel& panel, const Table& table, std::string_view x, std::string_view y,
                 Units units, bool marked) {
  for (const std::string& method : methods_in(table)) {
    const Mark mark = marked ? mark_of(panel.series.size()) : Mark::none;
    panel.series.push_back(
        {method, points(table, {{"method", method}}, x, y, units), Line::solid, mark});
  }
}

void add_reference(Panel& panel, const Table& table, std::string name, std::string_view x,
                   std::string_view y, Units units, Line line) {
  for (const std::string& method : methods_in(table)) {
    panel.series.push_back({std::move(name), points(table, {{"method", method}}, x, y, units), line,
                            Mark::none, grey});
    return;
  }
}

Panel by_group(const Table& table, const std::function<std::string(std::size_t)>& group,
               const std::function<double(const std::vector<std::size_t>&)>& value, Axis x) {
  Panel panel{.x = std::move(x)};
  std::map<std::pair<std::string, std::string>, std::vector<std::size_t>> members;
  std::vector<std::string>& groups = panel.y.names;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string name = group(row);
    if (name.empty()) continue;
    if (std::find(groups.begin(), groups.end(), name) == groups.end()) groups.push_back(name);
    members[{name, table.text(row, "method")}].push_back(row);
  }
  for (const std::string& method : methods_in(table)) {
    panel.series.push_back({method, {}, Line::none, mark_of(panel.series.size())});
    for (std::size_t i = 0; i < groups.size(); ++i) {
      const auto found = members.find({groups[i], method});
      if (found != members.end())
        panel.series.back().points.push_back({value(found->second), static_cast<double>(i + 1)});
    }
  }
  return panel;
}

}  // namespace palpate::lab
