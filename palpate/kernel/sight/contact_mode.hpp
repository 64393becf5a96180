// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace palpate {

/// The mode of a contact: what is known of the surface, and what the proxy rests on.
/// docs/sight.md, 2.
enum class ContactMode : std::uint8_t {
  free,             ///< the proxy is at the hand, and no surface is followed
  approaching,      ///< the proxy is at the hand; the surface behind it is followed
  on_fit,           ///< the proxy rests on the fit of a surface that is followed
  on_points,        ///< it rests on points of a surface that is followed
  on_stray_points,  ///< it rests on points, and no surface is followed
  free_hidden,      ///< as `approaching`, with the surface held as it was, because it is hidden
  on_hidden_fit,    ///< as `on_fit`, likewise
  on_hidden_points  ///< as `on_points`, likewise
};
inline constexpr std::size_t contact_modes = 8;

/// What changes the mode: the first four are what a frame shows, the others how a tick ended.
enum class Evidence : std::uint8_t {
  seen,       ///< enough points lie where a surface is, or is expected
  hidden,     ///< an occluder or nothing is measured there
  lost,       ///< there is no surface to follow, or it is not the hand's any more
  on_fit,     ///< the HIP is deeper than r_c in the fit
  on_points,  ///< the fit does not describe the points there, or there is none
  left        ///< the proxy reached the HIP
};
inline constexpr std::size_t evidences = 6;

/// The mode after `evidence`: the only place where modes change. A surface that is not followed can
/// be neither hidden nor rested on: there, such evidence changes nothing.
constexpr ContactMode next_mode(ContactMode mode, Evidence evidence) noexcept {
  using enum ContactMode;
  constexpr std::array<std::array<ContactMode, evidences>, contact_modes> table = {{
      // seen       hidden            lost             on_fit         on_points         left
      {approaching, free, free, free, on_stray_points, free},                    // free
      {approaching, free_hidden, free, on_fit, on_points, approaching},          // approaching
      {on_fit, on_hidden_fit, on_stray_points, on_fit, on_points, approaching},  // on_fit
      {on_points, on_hidden_points, on_stray_points, on_fit, on_points, approaching},  // on_points
      {on_points, on_stray_points, on_stray_points, on_stray_points, on_stray_points,
       free},  // on_stray_points
      {approaching, free_hidden, free, on_hidden_fit, on_hidden_points,
       free_hidden},  // free_hidden
      {on_fit, on_hidden_fit, on_stray_points, on_hidden_fit, on_hidden_points,
       free_hidden},  // on_hidden_fit
      {on_points, on_hidden_points, on_stray_points, on_hidden_fit, on_hidden_points,
       free_hidden},  // on_hidden_points
  }};
  return table[static_cast<std::size_t>(mode)][static_cast<std::size_t>(evidence)];
}

/// Does the proxy touch?
constexpr bool touches(ContactMode mode) noexcept {
  using enum ContactMode;
  return mode != free && mode != approaching && mode != free_hidden;
}
/// Is the surface hidden, and held as it was?
constexpr bool is_hidden(ContactMode mode) noexcept { return mode >= ContactMode::free_hidden; }
/// Is a surface followed, or held?
constexpr bool is_followed(ContactMode mode) noexcept {
  return mode != ContactMode::free && mode != ContactMode::on_stray_points;
}
constexpr bool rests_on_fit(ContactMode mode) noexcept {
  return mode == ContactMode::on_fit || mode == ContactMode::on_hidden_fit;
}

}  // namespace palpate
