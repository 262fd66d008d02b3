within ;
package Fan "A fan on an electric motor"
  partial model PartialFriction "Slot: from speed to torque"
    input Real w(unit="rad/s") "Speed";
    output Real tau(unit="N.m") "Torque against it";
  end PartialFriction;

  model NoFriction "Null version"
    extends PartialFriction;
  equation
    tau = 0.0;
  end NoFriction;

  model BearingFriction "a bearing that rubs"
    extends PartialFriction;
    parameter Real tau_c(unit="N.m", min=0.0, max=1.0) = 0.0 "Dry friction";
  equation
    tau = tau_c*tanh(w/0.5);
    annotation (__Workbench(effect(
      size="tau_c", matters=2e-3, separation="the speed while it runs out")));
  end BearingFriction;

  model Grease "grease that is stiff"
    extends PartialFriction;
    parameter Real d(unit="N.m.s/rad", min=0.0, max=0.1) = 0.0 "Viscous friction";
  equation
    tau = d*w;
    annotation (__Workbench(effect(
      size="d", matters=5e-5, separation="the speed while it runs out")));
  end Grease;

  partial model PartialSupply "Slot: from voltage set to voltage at the motor"
    input Real u(unit="V") "As set";
    output Real v(unit="V") "At the motor";
  end PartialSupply;

  model Supply "Null version"
    extends PartialSupply;
  equation
    v = u;
  end Supply;

  model BrushDrop "brushes that take a voltage"
    extends PartialSupply;
    parameter Real drop(unit="V", min=0.0, max=3.0) = 0.0 "Of both brushes";
  equation
    v = u - drop*tanh(u/0.5);
    annotation (__Workbench(effect(
      size="drop", matters=0.02, separation="the current at standstill")));
  end BrushDrop;

  model SupplyGain "a supply whose scale is wrong"
    extends PartialSupply;
    parameter Real gain(unit="1", min=-0.2, max=0.2) = 0.0 "Relative change";
  equation
    v = (1.0 + gain)*u;
    annotation (__Workbench(effect(
      size="gain", matters=2e-3, separation="a voltmeter at the motor")));
  end SupplyGain;

  model Observer "Motor, fan, winding"
    parameter Real J(unit="kg.m2") = 0.02 "Inertia";
    parameter Real k(unit="V.s/rad") = 0.5 "Constant of the motor";
    parameter Real c(unit="N.m.s2/rad2") = 5e-4 "Drag of the fan";
    parameter Real R(unit="Ohm") = 1.0 "Winding, cold";
    parameter Real alpha(unit="1/K") = 3.9e-3 "Copper";
    parameter Real C(unit="J/K") = 40.0 "Heat capacity of the winding";
    parameter Real G(unit="W/K") = 0.4 "From the winding to the air";
    input Real u(unit="V") "Voltage";
    input Real dc(unit="N.m.s2/rad2") "Correction of c";
    output Real w(unit="rad/s", start=0.0, fixed=true, nominal=20.0) "Speed";
    Real T(unit="K", start=0.0, fixed=true, nominal=20.0) "Winding, above the air";
    output Real i(unit="A") "Current";
    replaceable NoFriction friction(w=w) constrainedby PartialFriction(w=w) "Bearing";
    replaceable Supply supply(u=u) constrainedby PartialSupply(u=u) "Supply";
  equation
    i = (supply.v - k*w)/(R*(1.0 + alpha*T));
    J*der(w) = k*i - (c + dc)*w*abs(w) - friction.tau;
    C*der(T) = R*(1.0 + alpha*T)*i^2 - G*T;
  end Observer;
end Fan;
