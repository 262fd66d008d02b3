within ;
package Boiler
  model Vessel "Water that is heated through its wall, above the temperature of the room"
    parameter Real C(unit = "J/K") = 2000 "Heat capacity of the water";
    parameter Real CWall(unit = "J/K") = 500 "Heat capacity of the wall";
    parameter Real GWall(unit = "W/K") = 100 "From the wall to the water";
    parameter Real G(unit = "W/K") = 10 "From the water to the room";
    input Real P(unit = "W") "Heat into the wall";
    input Real dG(unit = "W/K") "Correction of G";
    Real T(unit = "K", start = 0.0, fixed = true, nominal = 50) "Water";
    Real TWall(unit = "K", start = 0.0, fixed = true, nominal = 50) "Wall";
    output Real TSkin(unit = "K") "Skin, between wall and water";
  equation
    CWall*der(TWall) = P - GWall*(TWall - T);
    C*der(T) = GWall*(TWall - T) - (G + dG)*T;
    TSkin = 0.7*TWall + 0.3*T;
  end Vessel;
end Boiler;
