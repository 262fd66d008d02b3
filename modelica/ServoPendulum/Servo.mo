within ServoPendulum;
model Servo "A servo with a pendulum, without friction"
  parameter Real kt(unit="N.m/A", min=1e-3) = 0.37 "Torque per current, behind the gear";
  parameter Real R(unit="Ohm", min=0.1) = 4.0 "Resistance of winding, bridge and supply";
  parameter Real J(unit="kg.m2", min=1e-6) = 0.002 "Inertia of the motor, behind the gear";
  parameter Real q0(unit="rad") = 0.02 "Reading where the arm hangs, negative";
  parameter Real m(unit="kg", min=1e-3) = 0.49 "Mass of the weight";
  parameter Real l(unit="m", min=1e-3) = 0.1 "Length of the arm";
  parameter Real g(unit="m/s2") = 9.80665 "Gravity";
  parameter Real kp(unit="1", min=0.0) = 400.0 "Gain of the controller, as the servo counts it";
  parameter Real perGain(unit="1/rad", min=0.0) = 4096.0/6.283185307179586/(256.0*885.0)
    "Duty per position error at a gain of 1: steps of the encoder, scale of gain and duty";
  parameter Real tauF(unit="N.m") = 0.0 "Dry friction that observers follow";
  parameter Real w0(unit="rad/s", min=1e-6) = 0.01 "Speed below which tauF is smoothed";

  input Real goal(unit="rad") "Position that is asked for";
  input Real volts(unit="V") "Supply voltage";
  input Real enabled(unit="1") "1 where the motor is driven, 0 where its bridge is open";
  input Real dtauF(unit="N.m") "Correction of tauF";

  output Real position(unit="rad", start=0.0, fixed=true, nominal=0.1) "Of the shaft";
  output Real speed(unit="rad/s", start=0.0, fixed=true, nominal=1.0) "Of the shaft";
  output Real reading(unit="rad") = encoder.y "What the servo reports as its position";
  output Real torque(unit="N.m") = kt*current.y "Of the motor, behind the gear";

  replaceable Common.Signals.Unchanged command(u=goal)
    constrainedby Common.Interfaces.Signal(u=goal) "From the goal to what the controller follows";
  replaceable Common.Signals.Unchanged gain(u=kp*perGain*(command.y - position))
    constrainedby Common.Interfaces.Signal(u=kp*perGain*(command.y - position))
    "Duty before its limit";
  replaceable Common.Signals.Unchanged bridge(u=duty*volts)
    constrainedby Common.Interfaces.Signal(u=duty*volts) "Mean voltage at the winding";
  replaceable Drive.NominalResistance resistance(u=R, duty=duty, current=current.y)
    constrainedby Drive.PartialResistance(u=R, duty=duty, current=current.y)
    "Resistance that acts";
  replaceable Common.Signals.Unchanged current(u=enabled*(bridge.y - kt*speed)/resistance.y)
    constrainedby Common.Interfaces.Signal(u=enabled*(bridge.y - kt*speed)/resistance.y)
    "Current that makes torque";
  replaceable Common.Signals.Unchanged weight(u=m*g*l)
    constrainedby Common.Interfaces.Signal(u=m*g*l) "Torque of the weight at a level arm";
  replaceable Common.Friction.Frictionless friction(v=speed, load=torque + hanging)
    constrainedby Common.Interfaces.Friction(v=speed, load=torque + hanging)
    "Gear and bearings; the load is what the motor and the weight press on the teeth";
  replaceable Common.Friction.Frictionless driveFriction(v=speed, load=torque)
    constrainedby Common.Interfaces.Friction(v=speed, load=torque)
    "First stages of the gear, which feel the motor alone";
  replaceable Common.Signals.Unchanged encoder(u=position)
    constrainedby Common.Interfaces.Signal(u=position) "From the position to what is reported";

protected
  Real duty(unit="1") "Share of time in which the bridge is on, with the sign of the voltage";
  Real hanging(unit="N.m") "Torque of the weight, against the angle";
equation
  duty = noEvent(max(-1.0, min(1.0, gain.y)));
  hanging = weight.y*sin(position + q0);
  der(position) = speed;
  (J + m*l^2)*der(speed) = torque - hanging - friction.f - driveFriction.f
    - (tauF + dtauF)*tanh(speed/w0);
  annotation (
    experiment(StopTime=6.0, Tolerance=1e-6),
    Documentation(info="<html>
<p><code>(J + m*l^2)*q'' = kt*i - m*g*l*sin(q + q0)</code>, <code>i = (duty*volts - kt*q')/R</code>,
<code>duty = kp*perGain*(goal - q)</code> within &plusmn;1. Where the motor is not enabled its bridge is
open: no current flows, and turning it induces none. The inductance of the winding (some 0.1 ms) is
left out, and so is the encoder's resolution in the loop.</p>
<h4>Slots</h4>
<p>In the order of the signal: command, gain, bridge, resistance, current, weight, friction, encoder.
A sensor's error changes the reading and nothing else.</p>
</html>"));
end Servo;
