// A ros2_control controller around an exported law. Its parameters: joints, interface (effort, or position for a servo's
// set-point), and the gains, bounds and estimator's numbers by their names, such as law.k1 and u_max. Of many joints
// law.k[1] is the parameter law.k_1. The reference comes as ~/reference: a number for each joint, or these and then the
// rates, or then the accelerations, too; what is left out is 0.
#include <atomic>
#include <cmath>
#include <string>
#include <vector>

#include "controller_interface/controller_interface.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "smc_loop.h"
#include "std_msgs/msg/float64_multi_array.hpp"

namespace @package@
{
using controller_interface::CallbackReturn;
using controller_interface::InterfaceConfiguration;
using controller_interface::interface_configuration_type;
using controller_interface::return_type;

class SmcController : public controller_interface::ControllerInterface
{
public:
  CallbackReturn on_init() override
  {
    value_.resize(static_cast<std::size_t>(smc_loop_numbers()));
    smc_loop_start(value_.data());
    joints_ = static_cast<std::size_t>(smc_loop_joints());
    references_ = std::vector<std::atomic<double>>(3 * joints_);
    std::vector<std::string> names;
    for (std::size_t i = 0; i < joints_; i++) {
      names.push_back("joint" + std::to_string(i + 1));
    }
    auto_declare<std::vector<std::string>>("joints", names);
    auto_declare<std::string>("interface", "@interface@");
    for (int i = 0; smc_loop_parameter(i); i++) {
      const std::string name = smc_loop_parameter(i);
      auto_declare<double>(ros_name(name), value_[static_cast<std::size_t>(smc_loop_index(name.c_str()))]);
    }
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_configure(const rclcpp_lifecycle::State &) override
  {
    names_ = get_node()->get_parameter("joints").as_string_array();
    interface_ = get_node()->get_parameter("interface").as_string();
    if (names_.size() != joints_) {
      RCLCPP_ERROR(get_node()->get_logger(), "the law is of another number of joints: give as many names in joints");
      return CallbackReturn::ERROR;
    }
    if (std::fabs(get_update_rate() * smc_loop_period() - 1.0) > 1e-6) {
      RCLCPP_ERROR(get_node()->get_logger(), "the law runs at @rate@ Hz: set update_rate to that");
      return CallbackReturn::ERROR;
    }
    if (!start()) {
      return CallbackReturn::ERROR;
    }
    subscription_ = get_node()->create_subscription<std_msgs::msg::Float64MultiArray>(
      "~/reference", 1, [this](const std_msgs::msg::Float64MultiArray & message) {
        const std::size_t given = message.data.size();
        if (given == joints_ || given == 2 * joints_ || given == 3 * joints_) {
          for (std::size_t i = 0; i < references_.size(); i++) {
            references_[i] = i < given ? message.data[i] : 0.0;
          }
        }
      });
    return CallbackReturn::SUCCESS;
  }

  InterfaceConfiguration command_interface_configuration() const override
  {
    std::vector<std::string> names;
    for (const auto & name : names_) {
      names.push_back(name + "/" + interface_);
    }
    return {interface_configuration_type::INDIVIDUAL, names};
  }

  InterfaceConfiguration state_interface_configuration() const override
  {
    std::vector<std::string> names;
    for (const auto & name : names_) {
      names.push_back(name + "/position");
    }
    for (const auto & name : names_) {
      if (takes("v")) {
        names.push_back(name + "/velocity");
      }
    }
    return {interface_configuration_type::INDIVIDUAL, names};
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State &) override
  {
    if (!start()) {
      return CallbackReturn::ERROR;
    }
    for (std::size_t i = 0; i < joints_; i++) {
      const auto x = state_interfaces_[i].get_optional();
      if (!x) {
        return CallbackReturn::ERROR;
      }
      references_[i] = *x;  // hold the pose until a reference comes
      references_[joints_ + i] = references_[2 * joints_ + i] = 0.0;
    }
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override
  {
    bool released = true;
    for (std::size_t i = 0; i < joints_; i++) {
      released = command_interfaces_[i].set_value(@rest@) && released;
    }
    return released ? CallbackReturn::SUCCESS : CallbackReturn::ERROR;
  }

  return_type update(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    for (std::size_t i = 0; i < joints_; i++) {
      const auto x = state_interfaces_[i].get_optional();
      if (!x) {  // the hardware holds it: the law is not called without a measurement
        return return_type::ERROR;
      }
      at("x", i) = *x;
      at("r", i) = references_[i];
      at("dr", i) = references_[joints_ + i];
      if (takes("ddr")) {
        at("ddr", i) = references_[2 * joints_ + i];
      }
      if (takes("v")) {
        const auto v = state_interfaces_[joints_ + i].get_optional();
        if (!v) {
          return return_type::ERROR;
        }
        at("v", i) = *v;
      }
    }
    if (smc_loop_step(value_.data())) {
      return return_type::ERROR;
    }
    bool taken = true;
    for (std::size_t i = 0; i < joints_; i++) {
      taken = command_interfaces_[i].set_value(at("u", i)) && taken;
    }
    return taken ? return_type::OK : return_type::ERROR;
  }

private:
  static std::string ros_name(std::string name)  // brackets are none of a parameter's name
  {
    for (auto & letter : name) {
      letter = letter == '[' ? '_' : letter;
    }
    if (!name.empty() && name.back() == ']') {
      name.pop_back();
    }
    return name;
  }

  bool start()  // from the state of a run's start, with the gains that the parameters have
  {
    smc_loop_start(value_.data());
    for (int i = 0; smc_loop_parameter(i); i++) {
      const std::string name = smc_loop_parameter(i);
      const double number = get_node()->get_parameter(ros_name(name)).as_double();
      if (smc_loop_set(value_.data(), smc_loop_index(name.c_str()), number)) {
        RCLCPP_ERROR(get_node()->get_logger(), "a gain or a bound is out of its range");
        return false;
      }
    }
    return true;
  }

  bool takes(const std::string & name) const
  {
    return smc_loop_index((joints_ > 1 ? name + "[1]" : name).c_str()) >= 0;
  }

  double & at(const std::string & name, std::size_t i)
  {
    const std::string element = joints_ > 1 ? name + "[" + std::to_string(i + 1) + "]" : name;
    return value_[static_cast<std::size_t>(smc_loop_index(element.c_str()))];
  }

  std::vector<double> value_;
  std::size_t joints_{1};
  std::vector<std::string> names_;
  std::string interface_;
  std::vector<std::atomic<double>> references_;
  rclcpp::Subscription<std_msgs::msg::Float64MultiArray>::SharedPtr subscription_;
};
}  // namespace @package@

PLUGINLIB_EXPORT_CLASS(@package@::SmcController, controller_interface::ControllerInterface)
