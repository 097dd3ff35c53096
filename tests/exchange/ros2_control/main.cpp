// Prints the interfaces of the controller, then its command for each line "t x v r r' r''" read, activated at each t = 0;
// 1 if it takes another rate.
#include <cstdio>

#include "controller_interface/controller_interface.hpp"

std::unique_ptr<controller_interface::ControllerInterface> made();

int main()
{
  auto controller = made();
  using controller_interface::CallbackReturn;
  controller->on_init();
  controller->rate = 500;
  if (controller->on_configure({}) != CallbackReturn::ERROR) return 1;
  controller->rate = 1000;
  if (controller->on_configure({}) != CallbackReturn::SUCCESS) return 2;
  for (auto & name : controller->command_interface_configuration().names) std::printf("%s ", name.c_str());
  for (auto & name : controller->state_interface_configuration().names) std::printf("%s ", name.c_str());
  std::printf("\n");
  double t, x, v, r, dr, ddr;
  while (std::scanf("%lf %lf %lf %lf %lf %lf", &t, &x, &v, &r, &dr, &ddr) == 6) {
    controller->state_interfaces_[0].value = x;
    controller->state_interfaces_[1].value = v;
    if (t == 0.0) {
      controller->on_activate({});
    }
    if (dr != 0.0 || ddr != 0.0) {
      controller->node->last->callback({{r, dr, ddr}});
    } else {
      controller->node->last->callback({{r}});
    }
    controller->update({}, {1e-3});
    std::printf("%.17g\n", controller->command_interfaces_[0].value);
  }
  using controller_interface::return_type;
  for (auto * interface : {&controller->state_interfaces_[0], &controller->command_interfaces_[0]}) {
    interface->held = true;
    if (controller->update({}, {1e-3}) != return_type::ERROR) return 3;
    interface->held = false;
  }
  if (controller->on_deactivate({}) != CallbackReturn::SUCCESS) return 4;
  return controller->command_interfaces_[0].value != 0.0;
}
