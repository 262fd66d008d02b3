package Belt "A motor that drives a load over a belt"
  import Common = Effects;

  partial model MotorReading "Slot: reading of the motor's speed"
    extends Common.Interfaces.Signal;
  end MotorReading;

  partial model LoadReading "Slot: reading of the load's speed"
    extends Common.Interfaces.Signal;
  end LoadReading;

  partial model Tension "Slot: torque of the belt"
    input Real nominal(unit="N.m") "By the linear law";
    input Real twist(unit="rad") "Twist";
    output Real actual(unit="N.m") "That acts";
  end Tension;

  model SameMotor "Null version"
    extends MotorReading;
  equation
    y = u;
  end SameMotor;

  model SameLoad "Null version"
    extends LoadReading;
  equation
    y = u;
  end SameLoad;

  model Linear "Null version"
    extends Tension;
  equation
    actual = nominal;
  end Linear;

  model MotorOffset "an offset of the motor's reading"
    extends MotorReading;
    extends Common.Signals.Offset(offset(unit="rad/s", min=-20.0, max=20.0));
    annotation (__Workbench(effect(size="offset", matters=0.1, separation="at rest")));
  end MotorOffset;

  model LoadDelay "a late reading of the load's speed"
    extends LoadReading;
    extends Common.Signals.Delay(window=4e-4);
    annotation (__Workbench(effect(size="delay", matters=2e-4, separation="one logger for all")));
  end LoadDelay;

  model LoadLag "a reading of the load's speed behind a lag"
    extends LoadReading;
    extends Common.Signals.Lag(window=4e-4);
    annotation (__Workbench(effect(size="lag", matters=2e-4, separation="one logger for all")));
  end LoadLag;

  model SofterBelt "a belt of another stiffness"
    extends Tension;
    parameter Real k(unit="N.m/rad", min=-19.0, max=100.0) = 0.0 "Change of stiffness";
  equation
    actual = nominal + k*twist;
    annotation (__Workbench(effect(size="k", matters=0.2, separation="a static pull")));
  end SofterBelt;

  model Observer "The drive"
    parameter Real Jm(unit="kg.m2") = 2e-3 "Inertia of the motor";
    parameter Real Jl(unit="kg.m2") = 1e-2 "Inertia of the load";
    parameter Real c(unit="N.m/rad") = 20.0 "Stiffness of the belt";
    parameter Real d(unit="N.m.s/rad") = 0.04 "Damping of the belt";
    parameter Real b(unit="N.m.s/rad") = 5e-3 "Friction of the load";
    input Real torque(unit="N.m") "Of the motor";
    Real vm(unit="rad/s", start=0.0, fixed=true, nominal=100.0) "Speed of the motor";
    Real vl(unit="rad/s", start=0.0, fixed=true, nominal=100.0) "Speed of the load";
    Real twist(unit="rad", start=0.0, fixed=true, nominal=0.1) "Twist";
    output Real wm(unit="rad/s") = motor.y "Reading of the motor";
    output Real wl(unit="rad/s") = load.y "Reading of the load";
    replaceable SameMotor motor(u=vm) constrainedby MotorReading(u=vm) "Encoder of the motor";
    replaceable SameLoad load(u=vl) constrainedby LoadReading(u=vl) "Encoder of the load";
    replaceable Linear belt(nominal=c*twist, twist=twist)
      constrainedby Tension(nominal=c*twist, twist=twist) "Belt";
  protected
    Real m(unit="N.m") "In the belt";
  equation
    m = belt.actual + d*(vm - vl);
    Jm*der(vm) = torque - m;
    Jl*der(vl) = m - b*vl;
    der(twist) = vm - vl;
  end Observer;

  annotation (uses(Effects(version="1.0")));
end Belt;
