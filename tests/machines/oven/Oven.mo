model Oven "Block in a casing"
  parameter Real C(unit="J/K", min=10.0, max=1000.0) = 80.0 "Heat capacity of the block";
  parameter Real K(unit="W/K") = 2.0 "From block to casing";
  parameter Real G(unit="W/K") = 0.5 "From casing to the surroundings";
  parameter Real offset(unit="W") = 0.0;
  input Real P(unit="W") "Heating power";
  input Real draught(unit="W/K");
  output Real T(unit="K", start=293.15, fixed=true, nominal=300.0, min=250.0, max=500.0) "Block";
  output Real loss(unit="W") = (G + draught)*(Tc - 293.15);
  Real Tc(unit="K", start=293.15, fixed=true, nominal=300.0) "Casing";
equation
  C*der(T) = P + offset - K*(T - Tc);
  200.0*der(Tc) = K*(T - Tc) - loss;
end Oven;
