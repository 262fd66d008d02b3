within TrainRig.Parts;
model SlideProtection "Valves of an axle that vent its cylinders while it slides"
  parameter Real on(unit="1", min=0.0, max=1.0) = 1.0 "1: it works; 0: it fills always";
  parameter Real slipVent(unit="1") = 0.12 "Slip beyond which it vents";
  parameter Real slipFill(unit="1") = 0.03 "Slip below which it fills";
  parameter Real tauVent(unit="s") = 0.2 "Time constant of venting";
  parameter Real tauFill(unit="s") = 0.45 "Time constant of filling";
  parameter Real slowest(unit="m/s") = 2.0 "Speed below which it fills";
  input Real v(unit="m/s") "Speed of the vehicle";
  input Real slip(unit="1") "Slip velocity over speed";
  input Real rate(unit="rad/s2") "Rate of the axle's angular velocity";
  Real passed(unit="1", start=1.0, fixed=true) "Share of the pressure that it passes on";
protected
  Real awake(unit="1") "1 above the slowest speed";
  Real vents(unit="1") "How much it vents";
  Real fills(unit="1") "How much it fills";
equation
  awake = on*noEvent(min(1.0, max(0.0, (v - slowest)/0.1)));
  vents = awake*noEvent(min(1.0, max(0.0, (slip - slipVent)/0.005)))
    *noEvent(min(1.0, max(0.0, -rate/2.0)));
  fills = 1.0 - awake*noEvent(min(1.0, max(0.0, 1.0 - (slipFill - slip)/0.005)));
  der(passed) = fills*(1.0 - passed)/tauFill - vents*passed/tauVent;
  annotation (Documentation(info="<html>
<p>It vents beyond <code>slipVent</code> while the wheel slows down, holds once it speeds up again, and
fills below <code>slipFill</code>.</p>
<h4>Implementation</h4>
<p>Each condition is a ramp, over half a percent of slip, 2 rad/s2 or 0.1 m/s, in place of a switch: there are no
events, and a controller that looks each 10 ms is not resolved either.</p>
</html>"));
end SlideProtection;
