// What an exported package uses of ROS 2, so that it compiles where there is no ROS.
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <map>
#include <string>
#include <type_traits>
#include <vector>

namespace rclcpp_lifecycle { struct State {}; }
namespace std_msgs { namespace msg { struct Float64MultiArray { std::vector<double> data; }; } }
namespace rclcpp
{
struct Time {};
struct Duration { double s; double seconds() const { return s; } };
struct Logger {};
template <class M> struct Subscription
{
  using SharedPtr = std::shared_ptr<Subscription<M>>;
  std::function<void(const M &)> callback;
};
}
struct Parameter
{
  std::string text;
  double number{0.0};
  std::vector<std::string> texts;
  std::string as_string() const { return text; }
  double as_double() const { return number; }
  std::vector<std::string> as_string_array() const { return texts; }
};
struct Node
{
  rclcpp::Subscription<std_msgs::msg::Float64MultiArray>::SharedPtr last;
  std::map<std::string, Parameter> parameters;
  Parameter get_parameter(const std::string & name) const { return parameters.at(name); }
  rclcpp::Logger get_logger() const { return {}; }
  template <class M, class F> typename rclcpp::Subscription<M>::SharedPtr create_subscription(const std::string &, int, F f)
  {
    return last = std::make_shared<rclcpp::Subscription<M>>(rclcpp::Subscription<M>{f});
  }
};
// as in ros2_control of 2026-08, where get_value() is gone
struct Interface
{
  double value;
  bool held = false;  // by the hardware
  [[nodiscard]] std::optional<double> get_optional() const { return held ? std::nullopt : std::optional<double>(value); }
  [[nodiscard]] bool set_value(double x) { value = held ? value : x; return !held; }
};
namespace controller_interface
{
enum class CallbackReturn { SUCCESS, ERROR };
enum class interface_configuration_type { INDIVIDUAL };
enum class return_type { OK, ERROR };
struct InterfaceConfiguration { interface_configuration_type type; std::vector<std::string> names; };
struct ControllerInterface
{
  virtual ~ControllerInterface() = default;
  virtual CallbackReturn on_init() = 0;
  virtual CallbackReturn on_configure(const rclcpp_lifecycle::State &) = 0;
  virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
  virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) = 0;
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual return_type update(const rclcpp::Time &, const rclcpp::Duration &) = 0;
  template <class T> void auto_declare(const std::string & name, const T & value)
  {
    Parameter & parameter = node->parameters[name];
    if constexpr (std::is_same_v<T, double>) {
      parameter.number = value;
    } else if constexpr (std::is_same_v<T, std::string>) {
      parameter.text = value;
    } else {
      parameter.texts = value;
    }
  }
  std::shared_ptr<Node> get_node() const { return node; }
  unsigned get_update_rate() const { return rate; }
  std::shared_ptr<Node> node = std::make_shared<Node>();
  unsigned rate = 1000;
  std::vector<Interface> state_interfaces_ = std::vector<Interface>(2), command_interfaces_ = std::vector<Interface>(1);
};
}
#define RCLCPP_ERROR(logger, text) (void)(logger), (void)(text)
#define PLUGINLIB_EXPORT_CLASS(type, base) std::unique_ptr<base> made() { return std::make_unique<type>(); }
