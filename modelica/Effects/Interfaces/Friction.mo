within Effects.Interfaces;
partial model Friction "Slot: what resists a motion"
  input Units.Speed v "Velocity or angular velocity";
  input Units.Load load "What the friction may grow with, such as a normal force; 0 if nothing";
  output Units.Resistance f "Resisting force or torque, with the sign of v";
  annotation (Documentation(info="<html>
<p>For straight motion in m/s and N, and for turning motion in rad/s and N.m. What several effects in
such a slot resist adds up.</p>
</html>"));
end Friction;
