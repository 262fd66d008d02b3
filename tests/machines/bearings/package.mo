within ;
package Bearings "A motor that drives a flywheel over an elastic shaft on two bearings"
  import Common = Effects;
  partial model Shaft "Torque of the shaft"
    input Real twist(unit="rad");
    input Real speed(unit="rad/s");
    input Real nominal(unit="N.m");
    output Real m(unit="N.m");
  end Shaft;
  model Elastic "Torque as nominal"
    extends Shaft;
  equation
    m = nominal;
  end Elastic;
  partial model Drive "Torque of the motor"
    input Real nominal(unit="N.m");
    output Real m(unit="N.m");
  end Drive;
  model Ideal
    extends Drive;
  equation
    m = nominal;
  end Ideal;
  model BearingFriction "more viscous friction in both bearings"
    extends Common.RotationalFriction.Viscous(damping(min=-4e-3, max=0.1));
    annotation (__Workbench(effect(
      size="damping", matters=2e-4, separation="a run-down")));
  end BearingFriction;
  model SoftShaft "a shaft that is softer"
    extends Shaft;
    parameter Real softer(unit="N.m/rad", min=-50.0, max=15.0) = 0.0 "Less stiffness";
  equation
    m = nominal - softer*twist;
    annotation (__Workbench(effect(
      size="softer", matters=0.4, separation="a torsion test")));
  end SoftShaft;
  model ShaftDamping "a shaft that damps more"
    extends Shaft;
    parameter Real damping(unit="N.m.s/rad", min=-0.04, max=1.0) = 0.0 "More damping";
  equation
    m = nominal + damping*speed;
    annotation (__Workbench(effect(
      size="damping", matters=2e-3, separation="a torsion test")));
  end ShaftDamping;
  model DriveGain "a drive that gives another share of its torque"
    extends Drive;
    parameter Real gain(unit="1", min=-0.5, max=0.5) = 0.0 "Share more";
  equation
    m = (1.0 + gain)*nominal;
    annotation (__Workbench(effect(
      size="gain", matters=0.01, separation="a torque sensor")));
  end DriveGain;
  model Observer "Motor and flywheel"
    parameter Real Jm(unit="kg.m2", min=1e-5) = 2e-3 "Inertia of the motor";
    parameter Real Jl(unit="kg.m2", min=1e-5) = 1e-2 "Inertia of the flywheel";
    parameter Real c(unit="N.m/rad") = 20.0 "Stiffness of the shaft";
    parameter Real d(unit="N.m.s/rad") = 0.04 "Damping of the shaft";
    parameter Real b(unit="N.m.s/rad") = 5e-3 "Friction of each bearing";
    parameter Real load(unit="N.m") = 0.0 "Load";
    input Real torque(unit="N.m") "Torque of the motor";
    input Real dload(unit="N.m") "Correction of the load";
    output Real wm(unit="rad/s", start=0.0, fixed=true, nominal=20.0) "Speed of the motor";
    output Real wl(unit="rad/s", start=0.0, fixed=true, nominal=20.0) "Speed of the flywheel";
    Real twist(unit="rad", start=0.0, fixed=true) "Twist of the shaft";
    replaceable Ideal drive(nominal=torque) constrainedby Drive(nominal=torque) "Drive";
    replaceable Elastic shaft(twist=twist, speed=wm - wl, nominal=c*twist + d*(wm - wl))
      constrainedby Shaft(twist=twist, speed=wm - wl, nominal=c*twist + d*(wm - wl)) "Shaft";
    replaceable Common.Friction.Frictionless motorBearing(v=wm, load=0.0)
      constrainedby Common.Interfaces.Friction(v=wm, load=0.0) "Bearing of the motor";
    replaceable Common.Friction.Frictionless loadBearing(v=wl, load=0.0)
      constrainedby Common.Interfaces.Friction(v=wl, load=0.0) "Bearing of the flywheel";
  equation
    Jm*der(wm) = drive.m - shaft.m - b*wm - motorBearing.f;
    Jl*der(wl) = shaft.m - b*wl - loadBearing.f - (load + dload);
    der(twist) = wm - wl;
  end Observer;
  annotation (uses(Effects(version="1.0")));
end Bearings;
