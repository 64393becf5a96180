// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

#include <boost/property_tree/ptree.hpp>
#include <boost/property_tree/xml_parser.hpp>
#include <gtest/gtest.h>

#include "lab/plot.hpp"

namespace palpate::lab {

/// A path of a drawing: a series' line or its marks.
struct DrawnPath {
  std::string name;  ///< escaped
  std::string data;
};

/// All of them in order. @throws boost::property_tree::xml_parser_error if it is not well-formed.
inline std::vector<DrawnPath> paths_of(const std::string& svg) {
  std::istringstream text(svg);
  boost::property_tree::ptree tree;
  read_xml(text, tree);
  const std::regex path("<path [^>]* d='([^']*)'><title>([^<]*)");
  std::vector<DrawnPath> paths;
  for (std::sregex_iterator at(svg.begin(), svg.end(), path), end; at != end; ++at)
    paths.push_back({(*at)[2], (*at)[1]});
  return paths;
}

/// Is the drawing well-formed, is every series with a point in it, and is there one?
inline void expect_drawn(const Figure& figure) {
  const std::vector<DrawnPath> paths = paths_of(svg(figure, "a <test> & \"more\""));
  bool any = false;
  for (const Panel& panel : figure.panels) {
    for (const Series& series : panel.series) {
      if (std::none_of(series.points.begin(), series.points.end(), [](const auto& point) {
            return std::isfinite(point[0]) && std::isfinite(point[1]);
          }))
        continue;
      any = true;
      EXPECT_TRUE(std::any_of(paths.begin(), paths.end(), [&](const DrawnPath& path) {
        return path.name == escaped(series.name);
      })) << series.name;
    }
  }
  EXPECT_TRUE(any) << "nothing is drawn";
}

}  // namespace palpate::lab
