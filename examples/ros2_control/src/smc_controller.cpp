// A ros2_control controller of one joint around the law in controller.c, which includes the exported super_twisting.c.
// The hardware must offer JOINT/position, JOINT/velocity and JOINT/effort, and update_rate must be the law's 1000 Hz.
#include <atomic>
#include <string>

#include "controller_interface/controller_interface.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "std_msgs/msg/float64.hpp"

extern "C" {
void controller_start(void);
void controller(double t, double x, double v, double r, double dr, double *u, double *s);
}

namespace smc_controller
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
    auto_declare<std::string>("joint", "joint1");
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_configure(const rclcpp_lifecycle::State &) override
  {
    joint_ = get_node()->get_parameter("joint").as_string();
    if (get_update_rate() != 1000) {
      RCLCPP_ERROR(get_node()->get_logger(), "the law runs at 1000 Hz: set update_rate to 1000");
      return CallbackReturn::ERROR;
    }
    subscription_ = get_node()->create_subscription<std_msgs::msg::Float64>(
      "~/reference", 1, [this](const std_msgs::msg::Float64 & message) { reference_ = message.data; });
    return CallbackReturn::SUCCESS;
  }

  InterfaceConfiguration command_interface_configuration() const override
  {
    return {interface_configuration_type::INDIVIDUAL, {joint_ + "/effort"}};
  }

  InterfaceConfiguration state_interface_configuration() const override
  {
    return {interface_configuration_type::INDIVIDUAL, {joint_ + "/position", joint_ + "/velocity"}};
  }

  CallbackReturn on_activate(const rclcpp_lifecycle::State &) override
  {
    controller_start();
    t_ = 0.0;
    const auto x = state_interfaces_[0].get_optional();
    if (!x) {
      return CallbackReturn::ERROR;
    }
    reference_ = *x;  // hold the pose until a reference comes
    return CallbackReturn::SUCCESS;
  }

  CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override
  {
    return command_interfaces_[0].set_value(0.0) ? CallbackReturn::SUCCESS : CallbackReturn::ERROR;
  }

  return_type update(const rclcpp::Time &, const rclcpp::Duration & period) override
  {
    const auto x = state_interfaces_[0].get_optional();
    const auto v = state_interfaces_[1].get_optional();
    if (!x || !v) {  // the hardware holds them: the law is not called without a measurement
      return return_type::ERROR;
    }
    double u, s;
    controller(t_, *x, *v, reference_, 0.0, &u, &s);
    t_ += period.seconds();
    return command_interfaces_[0].set_value(u) ? return_type::OK : return_type::ERROR;
  }

private:
  std::string joint_;
  std::atomic<double> reference_{0.0};
  double t_{0.0};  // s since the start, which is the time of the law
  rclcpp::Subscription<std_msgs::msg::Float64>::SharedPtr subscription_;
};
}  // namespace smc_controller

PLUGINLIB_EXPORT_CLASS(smc_controller::SmcController, controller_interface::ControllerInterface)
