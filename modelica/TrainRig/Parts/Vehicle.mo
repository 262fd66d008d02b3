within TrainRig.Parts;
model Vehicle "Mass of a vehicle along the track, and how it bears on its four axles"
  constant Real g(unit="m/s2") = 9.81 "Gravity";
  parameter Real tauBody(unit="s", min=1e-3) = 0.16 "Time in which the body pitches";
  parameter Real tauBogie(unit="s", min=1e-3) = 0.03 "Time in which a bogie frame pitches";
  input Real m(unit="kg") "Mass";
  input Real Fx[4](each unit="N") "Creep force of an axle, braking";
  input Real resistance(unit="N") "Of air, curves and gradients";
  Flange front "Coupling in front";
  Flange rear "Coupling behind";
  Real v(unit="m/s", start=0.0, fixed=true, nominal=20.0) "Speed";
  Real acceleration(unit="m/s2") "Rate of v";
  Real Q[4](each unit="N") "Load of one wheel of an axle";
  Real pitch(unit="m/s2", start=0.0, fixed=true) "Deceleration for which the body has pitched";
  Real moved[2](each unit="N", each start=0.0, each fixed=true, each nominal=1e4)
    "Force for which a bogie frame has pitched";
equation
  front.v = v;
  rear.v = v;
  der(v) = acceleration;
  m*acceleration = front.f + rear.f - sum(Fx) - resistance;
  tauBody*der(pitch) = -acceleration - pitch;
  for j in 1:2 loop
    tauBogie*der(moved[j]) = Fx[2*j - 1] + Fx[2*j] - moved[j];
    for i in 1:2 loop
      Q[2*j + i - 2] = 0.5*(m*(g/4.0 + pitch*1.3/38.0*(3 - 2*j)) + moved[j]*0.2*(3 - 2*i));
    end for;
  end for;
  annotation (Documentation(info="<html>
<p>At constant deceleration <code>a</code> the loads of the data sheet: <code>2*Q = m*g/4 +- a*m*1.3/(2*19)
+- (Fx of both axles of the bogie)*0.5/2.5</code>, front bogie and leading axle heavier. They follow with
the time in which a body or a bogie frame pitches, at the rates of 1 and 5 Hz that suspensions
usually have, so that no load is the cause of the force which is the cause of the load.</p>
<h4>Limitations</h4>
<p>First order in place of the pitch that swings. A coupler acts at the height of the centre of gravity.</p>
</html>"));
end Vehicle;
