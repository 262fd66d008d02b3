model Block "A heated block"
  parameter Real C(unit="J/K", min=1.0, max=1000.0) = 80.0 "Heat capacity";
  parameter Real G(unit="W/K", min=0.1, max=20.0) = 1.5 "To the surroundings";
  parameter Real a = 1.0 "Gain of the amplifier";
  parameter Real b = 1.0 "Efficiency";
  parameter Real idle = 3.0 "Moves nothing";
  input Real P(unit="W") "Heating power";
  output Real T(unit="K", start=0.0, fixed=true, nominal=20.0) "Above the surroundings";
equation
  C*der(T) = a*b*P - G*T;
end Block;
