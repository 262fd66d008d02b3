within PositioningStage;
model Stage "The carriage without friction, and its controller"
  parameter Real M(unit="kg", min=1.0) = 100.0 "Mass of the carriage, with motor and screw";
  parameter Real gtau(unit="N/V") = 35.15065188248547 "Force per command";
  parameter Real kp(unit="1/s", min=0.0) = 160.18 "Gain of the loop of the position";
  parameter Real kv(unit="V.s/m", min=0.0) = 243.45 "Gain of the loop of the speed";
  parameter Real limit(unit="V", min=0.0) = 10.0 "Of the command";
  parameter Real late(unit="s", min=1e-6) = 1e-3
    "By which the controller's speed is late: a mean of two samples, and their difference";
  parameter Real held(unit="s", min=1e-6) = 5e-4
    "By which the command acts late: half a sample, for which it is held";
  parameter Real f0(unit="N") = 0.0 "Force against the motion that observers follow";

  input Real goal(unit="m") "Position that is asked for";
  input Real pulse(unit="V") "Added to what the controller wants";
  input Real df0(unit="N") "Correction of f0";

  output Real q(unit="m", start=0.0, fixed=true, nominal=0.1) "Position";
  output Real speed(unit="m/s", start=0.0, fixed=true, nominal=0.1) "Of the carriage";
  output Real command(unit="V") = wanted + pulse "Of the drive";
  output Real reading(unit="m") = encoder.y "Of the encoder";

  replaceable Common.Signals.Unchanged drive(u=gtau*acting)
    constrainedby Common.Interfaces.Signal(u=gtau*acting) "From the command to the force";
  replaceable Common.Friction.Frictionless friction(v=speed, load=drive.y)
    constrainedby Common.Interfaces.Friction(v=speed, load=drive.y)
    "Screw and rails; the load is the force of the drive";
  replaceable Common.Signals.Unchanged encoder(u=q)
    constrainedby Common.Interfaces.Signal(u=q) "From the position to what is read";
  replaceable Interfaces.NoCables cables(position=q)
    constrainedby Interfaces.PartialCables(position=q) "What the carriage drags";

protected
  Real rate(unit="m/s", start=0.0, fixed=true) "Speed that the controller sees";
  Real acting(unit="V", start=0.0, fixed=true) "Command that acts";
  Real wanted(unit="V") "By the controller";
equation
  wanted = noEvent(max(-limit, min(limit, kv*(kp*(goal - q) - rate))));
  late*der(rate) = speed - rate;
  held*der(acting) = command - acting;
  der(q) = speed;
  M*der(speed) = drive.y - friction.f - cables.f - f0 - df0;
  annotation (
    experiment(StopTime=5.0, Tolerance=1e-8),
    Documentation(info="<html>
<p><code>M*q'' = gtau*command - friction - offset</code>; <code>command = kv*(kp*(goal - q) - q')</code>
within its limit, and a pulse.</p>
<h4>Sampling</h4>
<p>The controller works in samples of 1 ms. What they do to a motion of some 20 Hz is a delay, which is
a lag of first order here. The encoder does not disturb the loop: its steps are 0.05 um.</p>
</html>"));
end Stage;
