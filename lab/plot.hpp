// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "lab/table.hpp"

namespace palpate::lab {

constexpr double anything = std::numeric_limits<double>::infinity();
constexpr double fitting = std::numeric_limits<double>::quiet_NaN();

/// x and y. What is not a number interrupts a line; ±`anything` is at the end of its axis.
using Points = std::vector<std::array<double, 2>>;

enum class Line : std::uint8_t { none, solid, dashed, dotted, steps };
enum class Mark : std::uint8_t { none, disc, square, triangle, diamond, ring, cross, plus, dot };

/// The i-th of those that are told apart where they lie on one another: the first is filled.
constexpr Mark mark_of(std::size_t i) {
  return static_cast<Mark>(1 + i % 7);
}

constexpr int grey = -1;     ///< a colour: for what others are compared with
constexpr int by_name = -2;  ///< the next of the palette; the same for the same name

/// A curve or marks of a panel.
struct Series {
  std::string name = {};  ///< in the figure's key, once for each; empty: not there
  Points points = {};
  Line line = Line::solid;
  Mark mark = Mark::none;
  int colour = by_name;  ///< of the palette, from 0; in the second round lines are dashed
};

struct Axis {
  std::string label = {};
  bool log = false;
  double low = fitting;  ///< of the range
  double high = fitting;
  std::vector<std::string> names = {};  ///< of a vertical axis: at 1, 2, … from the top
};

struct Panel {
  std::string title = {};
  Axis x = {}, y = {};
  std::vector<Series> series = {};
};

struct Figure {
  std::vector<Panel> panels;
  std::size_t columns = 1;
};

/// The figure as an SVG that stands alone or in a page, light or dark as its reader's system is.
/// Its colours are told apart by those who are colour-blind. The same figure gives the same bytes.
std::string svg(const Figure& figure, std::string_view title);

/// Text as XML and HTML have it.
std::string escaped(std::string_view text);

/// What the numbers of x and y are divided by.
using Units = std::array<double, 2>;

/// Two columns of the rows that are meant.
Points points(const Table& table, Where where, std::string_view x, std::string_view y,
              Units units = {1.0, 1.0});
/// Of those that `keep(row)` is true for.
Points points(const Table& table, const std::function<bool(std::size_t)>& keep, std::string_view x,
              std::string_view y, Units units = {1.0, 1.0});

/// Adds a curve of each method of the column "method". @param marked  with its points
void add_methods(Panel& panel, const Table& table, std::string_view x, std::string_view y,
                 Units units = {1.0, 1.0}, bool marked = false);

/// Adds, in grey, what all methods are compared with, of the first one's rows.
void add_reference(Panel& panel, const Table& table, std::string name, std::string_view x,
                   std::string_view y, Units units = {1.0, 1.0}, Line line = Line::dashed);

/// A line a group and in it a mark a method. @param group  of a row, in none if empty
/// @param value  of a group's rows of one method; what is no number has no mark
Panel by_group(const Table& table, const std::function<std::string(std::size_t)>& group,
               const std::function<double(const std::vector<std::size_t>&)>& value, Axis x);

}  // namespace palpate::lab
