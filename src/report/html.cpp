// SPDX-License-Identifier: Apache-2.0
#include "report/html.h"

namespace blindcorner {

namespace embedded {
std::string_view report_asset(std::string_view name);
}

namespace {

constexpr const char* kStyle =
    "body{font:14px/1.45 system-ui,sans-serif;margin:1.5em auto;max-width:1180px;padding:0 1em;"
    "color:#1b1f24;background:#fff}h1{font-size:22px}p{max-width:60em}"
    "table{border-collapse:collapse;margin:1em 0;font-variant-numeric:tabular-nums}"
    "td,th{padding:2px 10px;text-align:right;border-bottom:1px solid #d9dee3}"
    "td:first-child,th:first-child{text-align:left}.open{color:#8b949d}"
    ".charts{display:flex;flex-wrap:wrap;gap:12px}";

/// JSON that may stand inside a script element: no "<" can open or close anything.
std::string script_safe(const std::string& text) {
  std::string safe;
  safe.reserve(text.size());
  for (const char character : text) {
    if (character == '<') {
      safe += "\\u003c";
    } else {
      safe += character;
    }
  }
  return safe;
}

}  // namespace

std::string html_safe(const std::string& text) {
  std::string safe;
  for (const char character : text) {
    switch (character) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '"':
        safe += "&quot;";
        break;
      default:
        safe += character;
    }
  }
  return safe;
}

std::string plain_page(const std::string& title, const std::string& body) {
  const std::string safe = html_safe(title);
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"><title>" +
         safe + "</title>\n<style>" + kStyle + "</style></head>\n<body><h1>" + safe + "</h1>\n" +
         body + "</body></html>\n";
}

std::string script_page(const std::string& title, const std::string& data,
                        const PageAssets& assets) {
  std::string page = "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n";
  page += "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
  page += "<title>" + html_safe(title) + " - blindcorner</title>\n<style>\n";
  page += embedded::report_asset(assets.style);
  page +=
      "</style>\n</head>\n<body>\n<main id=\"page\"></main>\n<noscript>This page draws its "
      "pictures with JavaScript.</noscript>\n<script";
  if (!assets.library.empty()) {
    page += ">\n";
    page += embedded::report_asset(assets.library);
    page += "\n</script>\n<script";
  }
  page += " type=\"application/json\" id=\"data\">" + script_safe(data);
  page += "</script>\n<script>\n";
  page += embedded::report_asset(assets.script);
  page += "</script>\n</body>\n</html>\n";
  return page;
}

}  // namespace blindcorner
