within AirSupply;
package Tests "Claims that the models must hold"
end Tests;
